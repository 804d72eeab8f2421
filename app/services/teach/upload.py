"""Take an episode in: recognize, extract, hold it against its task, then commit one row."""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

import numpy as np
from sqlalchemy import Connection

from app.perception.base import GivenPoses, ObjectQuery, numbered_queries
from app.perception.images import ImageBytes
from app.pipeline.alike import Alike, alike_findings
from app.pipeline.episode import Episode
from app.pipeline.findings import Finding
from app.pipeline.findings.elsewhere import unlike_findings
from app.pipeline.findings.recording import compared_findings, contact_findings, recording_findings
from app.pipeline.findings.units import check_recording, unit_findings
from app.pipeline.prompt import check_object_names
from app.services.pose_servers import PoseServers
from app.services.scene_images import put_images
from app.services.task_settings import TaskSettings
from app.services.teach.extract import Extracted, extract
from app.services.teach.known import KnownTask, check_objects, saying_which
from app.services.teach.room import room_findings, uploaded
from app.store import episodes, idempotency, predictions, tasks, trajectories
from app.store.errors import ConflictError, NotFoundError
from app.store.records import DemonstrationRecord, EpisodeDraft, EpisodeFields
from app.store.store import Store
from app.store.values import CameraRecord, JsonObject
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import settle
from roboprompt_client.types.names import checked_name
from roboprompt_client.types.poses import ObjectPose

MAX_ATTEMPTS = 3  # a task's settings may change while an episode is being extracted
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
        check_object_names(self.object_names, list(dict.fromkeys(self.object_names)))
        tracked = self.episode.trajectory.num_objects
        if tracked not in (0, len(self.objects)):
            message = f"has {tracked} objects, but objects has {len(self.objects)}"
            raise InvalidInputError("trajectory.object_positions", message, "(T, N, 3), in the order of objects")

    @property
    def object_names(self) -> list[str]:
        """In the order of the trajectory's tracks."""
        return [query.name for query in self.objects]

    @property
    def given(self) -> tuple[ObjectPose, ...]:
        """The poses that came with the recording."""
        return GivenPoses().estimate([query for query in self.objects if query.position_m is not None], ())


Respond = Callable[[EpisodeFields, TaskSettings], JsonObject]


@dataclass(frozen=True, eq=False)
class _Ready:
    """An episode, extracted for its task as it was read.

    Attributes:
        settings: of the task, with the arm's number of joints.
        findings: apart from those on the workspace.
    """

    task: KnownTask
    settings: TaskSettings
    draft: EpisodeDraft
    findings: tuple[Finding, ...]

    def outcome(self, task: KnownTask, respond: Respond) -> tuple[JsonObject, JsonObject]:
        """What becomes of the task with the workspace and first demonstrations of now: its settings, and the answer."""
        box = task.settings.workspace
        if not self.draft.left_out:
            box = uploaded(box, self.draft, task.first)
        settings = self.settings.within(box)
        findings = (*room_findings(box, self.draft, task.first), *self.findings)
        answer = {**respond(self.draft, settings), "findings": [finding.to_json() for finding in findings]}
        return settings.model_dump(mode="json"), answer


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
                _check_link(connection, upload)
                task = KnownTask.read(connection, upload.task, upload.objects)
            ready = self._ready(upload, task)
            if (answer := self._commit(upload, ready, respond)) is not None:
                return answer
        raise ConflictError(f"task {upload.task!r} kept changing during the upload: send the episode again")

    def _ready(self, upload: Upload, task: KnownTask) -> _Ready:
        """The steps of the method: what was recorded, is it of this task, keyframes and poses, what deserves a look."""
        episode, given, sent = upload.episode, upload.given, upload.object_names
        names = list(dict.fromkeys((*(task.object_names or ()), *sent)))
        settings = task.settings.with_joints_of(episode.trajectory)
        queries = settings.with_models(upload.objects)
        motion = settings.motion_of(episode.trajectory, episode.control_frequency_hz)
        self._pose_servers.check(settings.object_models)
        check_recording(motion, given, [frame.camera for frame in episode.frames])
        instruction = saying_which(episode.instruction, motion, given, upload.alike, np.array(settings.robot_base))
        others = check_objects(task, instruction, sent, given, motion)
        settings.check_models(names)
        extracted = extract(motion, queries, episode.frames, settings, names, self._store.blobs)
        compared = settings.compared(upload.objects, extracted.poses)
        new = DemonstrationRecord("", instruction, extracted.objects, extracted.keyframes)
        shown = [record.demonstration() for record in task.demonstrations]
        findings = (
            *others,
            *alike_findings(upload.alike, instruction),
            *unit_findings(episode.trajectory, extracted.poses),
            *compared_findings(compared),
            *recording_findings(motion, extracted.keyframes, settings.keyframes.keyframe_rule()),
            *contact_findings(motion, sent, episode.extra),
            *unlike_findings(new.demonstration(), shown),
        )
        cameras = put_images(self._store.blobs, [frame.camera for frame in episode.frames], upload.images)
        trajectory = trajectories.pack(episode.trajectory)
        return _Ready(task, settings, _draft(upload, instruction, extracted, cameras, trajectory), findings)

    def _commit(self, upload: Upload, ready: _Ready, respond: Respond) -> JsonObject | None:
        """The answer, or None if the task changed in what matters since it was read, or was deleted."""
        task, key = ready.task, upload.idempotency_key
        settings, answer = ready.outcome(task, respond)  # before the transaction: on SQLite others wait for it
        with self._store.write() as connection:
            if (before := _answer_before(connection, upload)) is not None:
                return before
            if (now := task.locked(connection)) is None:
                return None
            if (now.stored, now.first) != (task.stored, task.first):  # another upload has come in
                settings, answer = ready.outcome(now, respond)
            episodes.add(connection, ready.draft)
            if key is not None:
                idempotency.save(connection, SCOPE, key, upload.digest, answer)
            tasks.update_settings(connection, task.name, settings)
        return answer


def _draft(
    upload: Upload, instruction: str, extracted: Extracted, cameras: tuple[CameraRecord, ...], trajectory: bytes
) -> EpisodeDraft:
    """The episode's row, under an instruction that may have been given numbers."""
    episode = upload.episode
    sent = None if instruction == episode.instruction else episode.instruction
    return EpisodeDraft(
        task=upload.task,
        instruction=instruction,
        control_frequency_hz=episode.control_frequency_hz,
        keyframes=extracted.keyframes,
        objects=extracted.objects,
        given_objects=tuple(asdict(query) for query in upload.objects),
        cameras=cameras,
        extra=dict(episode.extra),
        prediction_id=upload.prediction_id,
        left_out=upload.left_out,
        note=upload.note,
        uploaded_instruction=upload.uploaded_instruction or sent,
        num_frames=len(episode.trajectory),
        trajectory=trajectory,
    )


def _answer_before(connection: Connection, upload: Upload) -> JsonObject | None:
    """What the same request was answered with, while its episode is there: after a deletion it may be sent again."""
    if upload.idempotency_key is None:
        return None
    stored = idempotency.find(connection, SCOPE, upload.idempotency_key, upload.digest)
    return stored if stored is not None and episodes.exist(connection, stored["id"]) else None


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


def content_digest(metadata: JsonObject, parts: Mapping[str, bytes]) -> str:
    """A digest of what a request says, whatever multipart boundary or key order it came with."""
    digest = hashlib.sha256(json.dumps(metadata, sort_keys=True).encode())
    for name in sorted(parts):
        digest.update(f"\0{name}\0".encode() + hashlib.sha256(parts[name]).digest())
    return digest.hexdigest()
