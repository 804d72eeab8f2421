"""`POST /episodes`: check an episode, extract keyframes and object poses, compare it with its task, store one row."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import NamedTuple

from sqlalchemy import Connection

from app.perception.base import GivenPoses, ObjectQuery, numbered_queries
from app.perception.images import ImageBytes
from app.pipeline.alike import Alike
from app.pipeline.episode import Episode
from app.pipeline.findings import Finding
from app.pipeline.findings.units import check_recording
from app.pipeline.findings.upload import upload_findings
from app.pipeline.names import check_object_names
from app.services.pose_servers import PoseServers
from app.services.scene_images import put_images
from app.services.task_settings import TaskSettings
from app.services.teach.extract import extract
from app.services.teach.stored_task import StoredTask, check_objects, numbered_instruction
from app.services.teach.workspace import uploaded
from app.store import episodes, idempotency, predictions, tasks, trajectories
from app.store.errors import ConflictError, NotFoundError
from app.store.records import EpisodeDraft, EpisodeFields
from app.store.store import Store
from app.store.values import JsonObject, KeyframeRecord, ObjectRecord
from app.store.visibility import present
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import settle
from roboprompt_client.types.camera import Camera
from roboprompt_client.types.names import checked_instruction, checked_name
from roboprompt_client.types.poses import ObjectPose

MAX_ATTEMPTS = 3  # a task's settings may change while an episode is being extracted


@dataclass(frozen=True, eq=False)
class Upload:
    """An episode with all that came with it.

    Attributes:
        images: per camera of `episode.frames`, by name.
        films: `.npz` files by camera, checked.
        prediction_id, corrects: see `EpisodeFields`.
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
    corrects: str | None = None
    left_out: bool = False
    note: str = ""
    uploaded_instruction: str | None = None
    alike: tuple[Alike, ...] = ()
    films: Mapping[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        checked_name("task", self.task)
        if self.uploaded_instruction is not None:
            checked_instruction("uploaded_instruction", self.uploaded_instruction)
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

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The cameras of the images."""
        return tuple(frame.camera for frame in self.episode.frames)

    def draft(
        self, instruction: str, keyframes: tuple[KeyframeRecord, ...], objects: tuple[ObjectRecord, ...]
    ) -> EpisodeDraft:
        """The episode as it is to be stored, its images and films aside."""
        episode, uploaded = self.episode, self.uploaded_instruction
        return EpisodeDraft(
            task=self.task,
            instruction=instruction,
            control_frequency_hz=episode.control_frequency_hz,
            keyframes=keyframes,
            objects=objects,
            given_objects=tuple(asdict(query) for query in self.objects),
            cameras=(),
            extra=dict(episode.extra),
            prediction_id=self.prediction_id,
            corrects=self.corrects,
            key_id=present().key_id or None,
            left_out=self.left_out,
            note=self.note,
            uploaded_instruction=uploaded or (None if instruction == episode.instruction else episode.instruction),
            num_frames=len(episode.trajectory),
            trajectory=trajectories.pack(episode.trajectory),
        )


Respond = Callable[[EpisodeFields, TaskSettings], JsonObject]


class _Extracted(NamedTuple):
    """An episode to be stored, with the settings it was extracted with and all findings but the workspace's."""

    settings: TaskSettings
    draft: EpisodeDraft
    findings: tuple[Finding, ...]


def _outcome(task: StoredTask, extracted: _Extracted, respond: Respond) -> tuple[JsonObject, JsonObject]:
    """Return the task's settings after the upload, with its new workspace, and the answer."""
    settings, draft, findings = extracted
    box, doubts = uploaded(task.settings.workspace, draft, task.first, stays=draft.left_out)
    settings = settings.within(box)
    answer = {**respond(draft, settings), "findings": [finding.to_json() for finding in (*doubts, *findings)]}
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
                _check_links(connection, upload)
                task = StoredTask.read(connection, upload.task, upload.objects)
            extracted = self._extracted(upload, task)
            if (answer := self._commit(upload, task, extracted, respond)) is not None:
                return answer
        raise ConflictError(f"task {upload.task!r} kept changing during the upload: send the episode again")

    def _extracted(self, upload: Upload, task: StoredTask) -> _Extracted:
        """Check the recording, find keyframes and poses, and collect the findings, in the order of the method."""
        episode, blobs = upload.episode, self._store.blobs
        settings = task.settings.with_joints_of(episode.trajectory)
        self._pose_servers.check(settings.object_models)
        motion = settings.motion_of(episode.trajectory, episode.control_frequency_hz)
        check_recording(motion, upload.given, upload.cameras)
        instruction = numbered_instruction(episode.instruction, motion, upload.given, upload.alike, settings.robot_base)
        others = check_objects(task, instruction, upload.object_names, upload.given, motion)
        names = list(dict.fromkeys((*(task.object_names or ()), *upload.object_names)))
        settings.check_models(names)
        queries = settings.with_models(upload.objects)
        keyframes, objects = extract(motion, queries, episode.frames, settings, names, blobs)
        draft = upload.draft(instruction, keyframes, objects)
        new = draft.demonstration()
        findings = upload_findings(
            new,
            motion,
            settings.keyframes.keyframe_rule(),
            tracked=upload.object_names,
            alike=upload.alike,
            compared=settings.compared(upload.objects, new.objects),
            extra=episode.extra,
            others=[record.demonstration() for record in task.demonstrations],
        )
        films = {camera: blobs.put(data) for camera, data in sorted(upload.films.items())}
        draft = replace(draft, cameras=put_images(blobs, upload.cameras, upload.images), films=films)
        return _Extracted(settings, draft, (*others, *findings))

    def _commit(self, upload: Upload, task: StoredTask, extracted: _Extracted, respond: Respond) -> JsonObject | None:
        """Store the episode; return the answer, or None if the task was deleted or must be extracted for anew."""
        settings, answer = _outcome(task, extracted, respond)  # not in the transaction: on SQLite other writers wait
        with self._store.write() as connection:
            if (before := _answer_before(connection, upload)) is not None:
                return before
            if (now := task.locked(connection)) is None:
                return None
            if (now.stored, now.first) != (task.stored, task.first):  # another upload changed the workspace meanwhile
                settings, answer = _outcome(now, extracted, respond)
            episodes.add(connection, replace(extracted.draft, findings=tuple(answer["findings"])))
            if upload.idempotency_key is not None:
                idempotency.save(connection, idempotency.UPLOAD, upload.idempotency_key, upload.digest, answer)
            tasks.update_settings(connection, task.name, settings)
        return answer


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
