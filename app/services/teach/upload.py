"""`POST /episodes`: check an episode, extract keyframes and object poses, compare it with its task, store one row."""

from dataclasses import asdict, replace

from sqlalchemy import Connection

from app.services.extract import keyframes_of, objects_of
from app.services.images import put_images
from app.services.poses import PoseServers
from app.services.teach.upload_checks import CheckedUpload, StoredTask, Upload, checked_upload
from app.store import episodes, predictions, tasks
from app.store.errors import ConflictError, NotFoundError
from app.store.records import EpisodeDraft, EpisodeRecord
from app.store.store import Store
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.trajectory import npz_from_trajectory

MAX_ATTEMPTS = 3  # a task's settings may change while an episode is being extracted


class UploadEpisode:
    """Stores uploaded episodes. Synchronous: call it in a thread."""

    def __init__(self, store: Store, pose_servers: PoseServers | None = None) -> None:
        self._store = store
        self._pose_servers = pose_servers or PoseServers()

    def __call__(self, upload: Upload) -> EpisodeRecord:
        """Extract and store the episode; nothing is stored if anything is wrong with it.

        Returns:
            The stored episode; where it was uploaded before with the same idempotency key, that one.

        Raises:
            InvalidInputError, ObjectSetError: if the episode does not fit.
            ConflictError: if the idempotency key came with other content.
        """
        for _ in range(MAX_ATTEMPTS):
            with self._store.read() as connection:
                if (before := _uploaded_before(connection, upload)) is not None:
                    return before
                _check_links(connection, upload)
            task = StoredTask.read(self._store, upload)
            self._pose_servers.check(task.settings.object_models)
            checked = checked_upload(upload, task)
            draft = self._draft(upload, checked)
            with self._store.write() as connection:
                if (before := _uploaded_before(connection, upload)) is not None:
                    return before
                if task.is_unchanged(connection):
                    record = episodes.add(connection, draft)
                    tasks.update_settings(connection, record.task, checked.settings.stored())
                    return record
        raise ConflictError(f"task {upload.task!r} kept changing during the upload: send the episode again")

    def _draft(self, upload: Upload, checked: CheckedUpload) -> EpisodeDraft:
        """Find keyframes and poses, and put the images; no transaction is open."""
        episode, blobs, settings = upload.episode, self._store.blobs, checked.settings
        keys = settings.extraction_keys
        draft = EpisodeDraft(
            task=upload.task,
            instruction=episode.instruction,
            control_frequency_hz=episode.control_frequency_hz,
            keyframes=keyframes_of(checked.motion, settings),
            keyframes_key=keys.keyframes,
            objects=objects_of(upload.objects, episode.frames, settings, checked.names, blobs),
            poses_key=keys.poses,
            given_objects=tuple(map(asdict, upload.objects)),
            cameras=(),
            extra=dict(episode.extra),
            prediction_id=upload.prediction_id,
            corrects=upload.corrects,
            upload_key=upload.idempotency_key,
            upload_digest=upload.digest if upload.idempotency_key else None,
            left_out=upload.left_out,
            note=upload.note,
            uploaded_instruction=upload.uploaded_instruction,
            num_frames=len(episode.trajectory),
            trajectory=npz_from_trajectory(episode.trajectory),
        )
        return replace(draft, cameras=put_images(blobs, upload.cameras, upload.images))


def _uploaded_before(connection: Connection, upload: Upload) -> EpisodeRecord | None:
    """Return the episode of an upload with the same key; None if there is none.

    Raises ConflictError if other content came with the key.
    """
    if (key := upload.idempotency_key) is None or (stored := episodes.uploaded_with(connection, key)) is None:
        return None
    if stored.upload_digest != upload.digest:
        raise ConflictError(f"Idempotency-Key {key!r} was used for other content: send a new key with new content")
    return stored


def _check_links(connection: Connection, upload: Upload) -> None:
    """Refuse a link to a prediction that the episode cannot have carried out, or cannot correct.

    Raises:
        InvalidInputError: if there is no such prediction, it is another task's, gave no actions to carry out, or its
            outcome is the other one.
    """
    for name, id_, is_success in (("prediction_id", upload.prediction_id, True), ("corrects", upload.corrects, False)):
        if id_ is not None and (fault := _fault_of_link(connection, upload.task, id_, is_success)):
            outcome = "gave actions and did not fail" if is_success else "did not succeed"
            raise InvalidInputError(name, fault, f"the id of a prediction of the task {upload.task!r} that {outcome}")


def _fault_of_link(connection: Connection, task: str, id_: str, is_success: bool) -> str:
    try:
        prediction = predictions.get(connection, id_)
    except NotFoundError:
        return f"{id_!r} is no prediction"
    if prediction.task != task:
        return f"is a prediction of the task {prediction.task!r}"
    if is_success and not prediction.actions:
        return "is a prediction without actions"
    if prediction.outcome_success is (not is_success):
        return f"is a prediction whose outcome was a {'failure' if is_success else 'success'}"
    return ""
