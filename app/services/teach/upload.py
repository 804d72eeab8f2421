"""`POST /episodes`: check an episode, extract keyframes and object poses, compare it with its task, store one row."""

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import NamedTuple

from sqlalchemy import Connection

from app.pipeline.findings import Finding
from app.pipeline.findings.recording import upload_findings
from app.services.compared import compared
from app.services.images import put_images
from app.services.poses import PoseServers
from app.services.task_settings import TaskSettings
from app.services.teach.extract import extract
from app.services.teach.upload_checks import CheckedUpload, StoredTask, Upload, checked_upload
from app.services.teach.workspace import uploaded
from app.store import episodes, idempotency, predictions, tasks
from app.store.errors import ConflictError, NotFoundError
from app.store.records import EpisodeDraft, EpisodeRecord
from app.store.store import Store
from app.store.values import JsonObject
from app.store.visibility import present
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.trajectory import npz_from_trajectory

MAX_ATTEMPTS = 3  # a task's settings may change while an episode is being extracted
Respond = Callable[[EpisodeRecord, TaskSettings], JsonObject]


class _Extracted(NamedTuple):
    """An episode to be stored, with the settings it was extracted with and all findings but the workspace's."""

    settings: TaskSettings
    draft: EpisodeDraft
    findings: tuple[Finding, ...]


class UploadEpisode:
    """Stores uploaded episodes. Synchronous: call it in a thread."""

    def __init__(self, store: Store, pose_servers: PoseServers | None = None) -> None:
        self._store = store
        self._pose_servers = pose_servers or PoseServers()

    def __call__(self, upload: Upload, respond: Respond) -> JsonObject:
        """Extract and store the episode; nothing is stored if anything is wrong with it.

        Args:
            respond: makes the answer, which is kept for a repeated request with the same idempotency key.

        Raises:
            InvalidInputError, ObjectSetError: if the episode does not fit.
            ConflictError: if the idempotency key came with other content.
        """
        for _ in range(MAX_ATTEMPTS):
            with self._store.read() as connection:
                if (answer := _answer_before(connection, upload)) is not None:
                    return answer
                _check_links(connection, upload)
                task = StoredTask.read(connection, upload)
            self._pose_servers.check(task.settings.object_models)
            checked = checked_upload(upload, task)
            extracted = self._extracted(upload, task, checked)
            if (answer := self._commit(upload, task, extracted, respond)) is not None:
                return answer
        raise ConflictError(f"task {upload.task!r} kept changing during the upload: send the episode again")

    def _extracted(self, upload: Upload, task: StoredTask, checked: CheckedUpload) -> _Extracted:
        """Find keyframes and poses, collect the findings, and put the images; no transaction is open."""
        episode, blobs, settings = upload.episode, self._store.blobs, checked.settings
        keyframes, objects = extract(checked.motion, upload.objects, episode.frames, settings, checked.names, blobs)
        draft = EpisodeDraft(
            task=upload.task,
            instruction=checked.instruction,
            control_frequency_hz=episode.control_frequency_hz,
            keyframes=keyframes,
            objects=objects,
            given_objects=tuple(map(asdict, upload.objects)),
            cameras=(),
            extra=dict(episode.extra),
            prediction_id=upload.prediction_id,
            corrects=upload.corrects,
            key_id=present().key_id or None,
            left_out=upload.left_out,
            note=upload.note,
            uploaded_instruction=upload.uploaded_instruction
            or (None if checked.instruction == episode.instruction else episode.instruction),
            num_frames=len(episode.trajectory),
            trajectory=npz_from_trajectory(episode.trajectory),
        )
        new = draft.demonstration()
        findings = upload_findings(
            new,
            checked.motion,
            settings.keyframes.keyframe_rule(),
            tracked=upload.object_names,
            alike=upload.alike,
            compared=compared(upload.objects, new.objects, settings),
            extra=episode.extra,
            others=[record.demonstration() for record in task.demonstrations],
        )
        cameras = put_images(blobs, upload.cameras, upload.images)
        films = {camera: blobs.put(data) for camera, data in sorted(upload.films.items())}
        draft = replace(draft, cameras=cameras, films=films)
        return _Extracted(settings, draft, (*checked.findings, *findings))

    def _commit(self, upload: Upload, task: StoredTask, extracted: _Extracted, respond: Respond) -> JsonObject | None:
        """Store the episode; return the answer, or None if the task was deleted or must be extracted for anew."""
        settings, answer = _outcome(task, extracted, respond)  # not in the transaction: on SQLite other writers wait
        with self._store.write() as connection:
            if (before := _answer_before(connection, upload)) is not None:
                return before
            if (now := task.locked(connection)) is None:
                return None
            if now is not task:
                settings, answer = _outcome(now, extracted, respond)
            episodes.add(connection, replace(extracted.draft, findings=tuple(answer["findings"])))
            if upload.idempotency_key is not None:
                idempotency.save(connection, idempotency.UPLOAD, upload.idempotency_key, upload.digest, answer)
            tasks.update_settings(connection, task.name, settings)
        return answer


def _outcome(task: StoredTask, extracted: _Extracted, respond: Respond) -> tuple[JsonObject, JsonObject]:
    """Return the task's settings after the upload, with its new workspace, and the answer."""
    settings, draft, findings = extracted
    box, beyond = uploaded(task.settings.workspace, draft, task.demonstrations, stays=draft.left_out)
    settings = settings.model_copy(update={"workspace": box})
    answer = {**respond(draft, settings), "findings": [finding.to_json() for finding in (*beyond, *findings)]}
    return settings.model_dump(mode="json"), answer


def _answer_before(connection: Connection, upload: Upload) -> JsonObject | None:
    """Return the stored answer to the same request; None if it is new, or its episode was deleted since."""
    if upload.idempotency_key is None:
        return None
    stored = idempotency.find(connection, idempotency.UPLOAD, upload.idempotency_key, upload.digest)
    return stored if stored is not None and episodes.exist(connection, stored["id"]) else None


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
