"""Take an episode in: extract, store images, then commit one row."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace

import numpy as np
from sqlalchemy import Connection

from app.perception.base import ObjectQuery, numbered_queries
from app.perception.images import ImageBytes
from app.pipeline.alike import Alike, alike_findings
from app.pipeline.episode import Episode
from app.pipeline.findings import Finding
from app.pipeline.findings.elsewhere import unlike_findings
from app.pipeline.findings.recording import check_moves, contact_findings
from app.pipeline.findings.units import check_recording_units
from app.pipeline.keyframes import Motion
from app.pipeline.prompt import check_object_names
from app.services.measures import note
from app.services.pose_servers import PoseServers
from app.services.scene_images import put_images
from app.services.task_settings import TaskSettings
from app.services.teach.configure import record_limits
from app.services.teach.extract import Extracted, extract
from app.services.teach.objects import check_objects, saying_which
from app.services.teach.room import FIRST, room_findings, uploaded
from app.store import episodes, idempotency, predictions, tasks, trajectories
from app.store.errors import ConflictError, NotFoundError
from app.store.records import DemonstrationRecord, EpisodeDraft, EpisodeFields, StoredResponse, TaskRecord
from app.store.store import Store
from app.store.values import CameraRecord, JsonObject
from roboprompt_client.arrays import settle
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import ObjectPose
from roboprompt_client.wording import checked_name

MAX_ATTEMPTS = 3  # a task's settings may change while an episode is being extracted
MAX_COMPARED = 30  # demonstrations that an upload is held against
SCOPE = idempotency.UPLOAD


@dataclass(frozen=True, eq=False)
class Upload:
    """An episode with all that came with it.

    Attributes:
        images: per camera of `episode.frames`, by name.
        prediction_id: of the prediction that the robot carried out in this episode.
        left_out, note, uploaded_instruction: see `EpisodeFields`; of an episode that was edited elsewhere.
        alike: the objects that came with one name, and are numbered in `objects`.
        digest: of the request's content; a repeated `idempotency_key` must come with the same.
    """

    task: str
    episode: Episode
    objects: tuple[ObjectQuery, ...]
    images: Mapping[str, ImageBytes]
    digest: str = ""
    idempotency_key: str | None = None
    prediction_id: str | None = None
    left_out: bool = False
    note: str = ""
    uploaded_instruction: str | None = None
    alike: tuple[Alike, ...] = ()

    def __post_init__(self) -> None:
        checked_name("task", self.task)
        if not self.alike:
            objects, alike = numbered_queries(self.objects)
            settle(self, objects=objects, alike=alike)
        if not self.objects:
            raise InvalidInputError("objects", "is empty", "at least one object with its name and pose or mask_ids")
        names = [query.name for query in self.objects]
        check_object_names(names, list(dict.fromkeys(names)))
        tracked = self.episode.trajectory.num_objects
        if tracked not in (0, len(names)):
            message = f"has {tracked} objects, but objects has {len(names)}"
            raise InvalidInputError("trajectory.object_positions", message, "(T, N, 3), in the order of objects")


Respond = Callable[[EpisodeFields, TaskSettings], JsonObject]


@dataclass(frozen=True, eq=False)
class _Attempt:
    """An upload, extracted for a task as it was read.

    Attributes:
        seen: the task; None if there was none.
        first: its first `FIRST` demonstrations.
        settings: of the task, or those that it is made with.
    """

    upload: Upload
    seen: TaskRecord | None
    first: tuple[DemonstrationRecord, ...]
    settings: JsonObject
    extracted: Extracted
    draft: EpisodeDraft
    respond: Respond

    def outcome(
        self, settings_before: JsonObject, first: Sequence[DemonstrationRecord]
    ) -> tuple[JsonObject, JsonObject]:
        """What becomes of a task with these settings and first demonstrations: its settings, and the answer."""
        settings = TaskSettings.model_validate(settings_before).with_joints_of(self.upload.episode.trajectory)
        if not self.upload.left_out:
            settings = uploaded(settings, self.extracted, first)
        found = (*room_findings(settings, self.extracted, first), *self.extracted.findings)
        findings = [item.to_json() for item in found]
        return settings.model_dump(mode="json"), {**self.respond(self.draft, settings), "findings": findings}


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
        note(task=upload.task)
        for _ in range(MAX_ATTEMPTS):
            with self._store.read() as connection:
                if (answer := _answer_before(connection, upload)) is not None:
                    return answer
                seen = None
                with suppress(NotFoundError):
                    seen = tasks.get(connection, upload.task)
                first = () if seen is None else episodes.demonstrations(connection, upload.task, FIRST)
            settings = _settings_of(seen, upload.objects)
            motion = settings.motion_of(upload.episode.trajectory, upload.episode.control_frequency_hz)
            upload = _saying_which(upload, motion, settings)
            extracted = self._extract(upload, motion, seen, settings)
            calibrated = [frame.camera for frame in upload.episode.frames]
            cameras = put_images(self._store.blobs, calibrated, upload.images)
            read = settings.model_dump(mode="json") if seen is None else seen.settings
            draft = _draft(upload, extracted, cameras)
            if (answer := self._commit(_Attempt(upload, seen, first, read, extracted, draft, respond))) is not None:
                return answer
        raise ConflictError(f"task {upload.task!r} kept changing during the upload: send the episode again")

    def _extract(self, upload: Upload, motion: Motion, task: TaskRecord | None, settings: TaskSettings) -> Extracted:
        settings.with_joints_of(motion.trajectory)
        self._pose_servers.check(settings.object_models)
        names, others, episode = [query.name for query in upload.objects], tuple[Finding, ...](), upload.episode
        if task is not None and task.object_names is not None:
            others = check_objects(self._store, task, settings, episode.instruction, upload.objects, motion)
            names = list(dict.fromkeys((*task.object_names, *names)))
        check_moves(motion)
        check_recording_units(motion, _given(upload.objects), [frame.camera for frame in episode.frames])
        extracted = extract(motion, upload.objects, episode.frames, settings, names, self._store.blobs)
        unlike = () if task is None else self._unlike(task.name, episode.instruction, extracted)
        alike = alike_findings(upload.alike, episode.instruction)
        contact = contact_findings(motion, [query.name for query in upload.objects], episode.extra)
        return replace(extracted, findings=(*others, *alike, *extracted.findings, *contact, *unlike))

    def _unlike(self, task: str, instruction: str, extracted: Extracted) -> tuple[Finding, ...]:
        with self._store.read() as connection:
            others = episodes.demonstrations(connection, task, MAX_COMPARED)
        new = DemonstrationRecord("", instruction, extracted.objects, extracted.keyframes)
        return tuple(unlike_findings(new.demonstration(), [record.demonstration() for record in others]))

    def _commit(self, attempt: _Attempt) -> JsonObject | None:
        """The answer, or None if the task changed in what matters since it was read, or was deleted."""
        upload, seen = attempt.upload, attempt.seen
        # before the transaction: on SQLite others wait for it
        settings, answer = attempt.outcome(attempt.settings, attempt.first)
        with self._store.write() as connection:
            if (before := _answer_before(connection, upload)) is not None:
                return before
            if seen is not None and not tasks.exists(connection, upload.task):
                return None
            task = tasks.get_or_create(connection, upload.task, attempt.settings)
            expected = _what_is_extracted(attempt.settings, None if seen is None else seen.object_names)
            if _what_is_extracted(task.settings, task.object_names) != expected:
                return None
            _check_link(connection, upload)
            first = episodes.demonstrations(connection, upload.task, FIRST)
            if (task.settings, first) != (attempt.settings, attempt.first):  # another upload has come in
                settings, answer = attempt.outcome(task.settings, first)
            episodes.add(connection, attempt.draft)
            tasks.update_settings(connection, upload.task, settings)
            if (key := upload.idempotency_key) is not None:
                idempotency.forget(connection, SCOPE, key)
                idempotency.save(connection, SCOPE, key, upload.digest, StoredResponse(201, answer))
            record_limits(connection, upload.task, task.settings, settings)
        return answer


def _saying_which(upload: Upload, motion: Motion, settings: TaskSettings) -> Upload:
    """The upload with an instruction that says by its number which of several objects of one name is meant."""
    if not upload.alike:
        return upload
    said = upload.episode.instruction
    text = saying_which(said, motion, _given(upload.objects), upload.alike, np.array(settings.robot_base))
    first = upload.uploaded_instruction or (None if text == said else said)
    return replace(upload, episode=replace(upload.episode, instruction=text), uploaded_instruction=first)


def _given(objects: Sequence[ObjectQuery]) -> tuple[ObjectPose, ...]:
    """Those whose poses came with the recording."""
    return tuple(
        ObjectPose(
            query.name,
            np.array(query.position_m),
            None if query.quaternion_xyzw is None else np.array(query.quaternion_xyzw),
        )
        for query in objects
        if query.position_m is not None
    )


def _what_is_extracted(
    settings: JsonObject, object_names: tuple[str, ...] | None
) -> tuple[JsonObject, tuple[str, ...] | None]:
    """What an extraction depends on: not the workspace, which grows with every episode that needs it."""
    return {name: value for name, value in settings.items() if name != "workspace"}, object_names


def _check_link(connection: Connection, upload: Upload) -> None:
    """Refuse a link to a prediction that the episode cannot have carried out.

    Raises:
        InvalidInputError: if there is no such prediction, it is another task's, gave no actions, or failed.
    """
    if upload.prediction_id is None:
        return
    valid = f"the id of a prediction of the task {upload.task!r} that gave actions and did not fail"
    try:
        prediction = predictions.get(connection, upload.prediction_id)
    except NotFoundError:
        raise InvalidInputError("prediction_id", f"{upload.prediction_id!r} is no prediction", valid) from None
    if prediction.task != upload.task:
        raise InvalidInputError("prediction_id", f"is a prediction of the task {prediction.task!r}", valid)
    if not prediction.actions or prediction.outcome_success is False:
        fault = "whose outcome was a failure" if prediction.actions else "without actions"
        raise InvalidInputError("prediction_id", f"is a prediction {fault}", valid)


def _answer_before(connection: Connection, upload: Upload) -> JsonObject | None:
    """What the same request was answered with, while its episode is there: after a deletion it may be sent again."""
    if upload.idempotency_key is None:
        return None
    stored = idempotency.find(connection, SCOPE, upload.idempotency_key, upload.digest)
    return stored.response if stored is not None and episodes.exist(connection, stored.response["id"]) else None


def _settings_of(task: TaskRecord | None, objects: Sequence[ObjectQuery]) -> TaskSettings:
    """The task's settings; for a new task the defaults, with the estimator that its first objects call for."""
    if task is not None:
        return TaskSettings.model_validate(task.settings)
    by_masks = all(query.position_m is None and query.mask_ids for query in objects)
    return TaskSettings(pose_estimator="masks" if by_masks else "given")


def _draft(upload: Upload, extracted: Extracted, cameras: tuple[CameraRecord, ...]) -> EpisodeDraft:
    return EpisodeDraft(
        task=upload.task,
        instruction=upload.episode.instruction,
        control_frequency_hz=upload.episode.control_frequency_hz,
        keyframes=extracted.keyframes,
        objects=extracted.objects,
        given_objects=tuple(asdict(query) for query in upload.objects),
        cameras=cameras,
        extra=dict(upload.episode.extra),
        prediction_id=upload.prediction_id,
        left_out=upload.left_out,
        note=upload.note,
        uploaded_instruction=upload.uploaded_instruction,
        num_frames=len(upload.episode.trajectory),
        trajectory=trajectories.pack(upload.episode.trajectory),
    )


def content_digest(metadata: JsonObject, parts: Mapping[str, bytes]) -> str:
    """A digest of what a request says, whatever multipart boundary or key order it came with."""
    digest = hashlib.sha256(json.dumps(metadata, sort_keys=True).encode())
    for name in sorted(parts):
        digest.update(f"\0{name}\0".encode() + hashlib.sha256(parts[name]).digest())
    return digest.hexdigest()
