"""Records that the store takes and returns: frozen values, independent of the database."""

from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Generic, Literal, NamedTuple, TypeVar
from uuid import uuid4

import numpy as np

from app.pipeline.episode import CONTROL_FREQUENCY_HZ, Demonstration
from app.store.values import CameraRecord, JsonObject, KeyframeRecord, ObjectRecord
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

T = TypeVar("T")
PredictionStatus = Literal["ok", "parse_error", "unsafe_action", "unsupported", "model_error"]
Fate = Literal["failure", "refused", "unknown", "success"]


@dataclass(frozen=True)
class Page(Generic[T]):
    """Some items, newest first, and the cursor of those that follow; None at the end."""

    items: tuple[T, ...]
    next_cursor: int | None


# Name, when it was made and version: a task that is deleted and made again counts its versions from the beginning.
TaskState = tuple[str, datetime, int]


@dataclass(frozen=True)
class TaskRecord:
    """A task."""

    name: str
    version: int  # grows with every change that may alter a prompt
    settings: JsonObject
    object_names: tuple[str, ...] | None  # in the first episode's order, or None while there is no episode
    created_at: datetime
    updated_at: datetime

    @property
    def state(self) -> TaskState:
        """Equal only while nothing changed that may alter a prompt."""
        return (self.name, self.created_at, self.version)


@dataclass(frozen=True)
class TaskCounts:
    """How much is stored of a task; successes and failures count the predictions whose outcome was recorded."""

    episodes: int = 0
    predictions: int = 0
    successes: int = 0
    failures: int = 0


class ExtractionKeys(NamedTuple):
    """Digests of the settings that keyframes and object poses were extracted with."""

    keyframes: str
    poses: str


@dataclass(frozen=True)
class DemonstrationRecord:
    """The columns of an episode that a prompt needs."""

    id: str
    instruction: str
    objects: tuple[ObjectRecord, ...]
    keyframes: tuple[KeyframeRecord, ...]
    control_frequency_hz: float = CONTROL_FREQUENCY_HZ

    def places_m(self) -> Array:
        """Return the positions (N, 3) of the hand at its keyframes and of the objects."""
        return np.array([item.position_m for items in (self.keyframes, self.objects) for item in items])

    def demonstration(self) -> Demonstration:
        """Return the episode as the pipeline's type."""
        poses = tuple(record.pose() for record in self.objects)
        rows = [(record.position_m, record.quaternion_xyzw, record.gripper_open) for record in self.keyframes]
        actions = tuple(EndEffectorAction.many(*zip(*rows, strict=True))) if rows else ()
        return Demonstration(self.instruction, poses, actions, self.id)


@dataclass(frozen=True, kw_only=True)
class EpisodeRecord(DemonstrationRecord):
    """An episode; its trajectory is read on its own."""

    id: str = field(default_factory=lambda: uuid4().hex)
    created_at: datetime = field(default_factory=lambda: datetime.now(UTC))
    sequence: int = 0  # in the order of uploads; 0 until it is stored
    task: str
    num_frames: int
    given_objects: tuple[JsonObject, ...]  # the objects as the caller sent them: their poses can be estimated again
    keyframes_key: str  # of the settings that `keyframes` was extracted with, see `ExtractionKeys`
    poses_key: str  # the same of `objects`
    cameras: tuple[CameraRecord, ...]
    extra: JsonObject | None = None  # what else was uploaded; None in lists, which do not read it
    prediction_id: str | None = None  # of the prediction that the episode carried out, if any
    corrects: str | None = None  # id of the failed prediction in whose scene the episode shows how it is done
    left_out: bool = False  # kept, but shown in no prompt
    note: str = ""  # what a person says of it
    upload_key: str | None = None  # the `Idempotency-Key` of its upload
    upload_digest: str | None = None  # SHA-256 of what was sent with that key, in hexadecimal
    uploaded_instruction: str | None = None  # what it came with, where `instruction` was corrected since
    findings: tuple[JsonObject, ...] = ()  # `Finding.to_json`


@dataclass(frozen=True, kw_only=True)
class EpisodeDraft(EpisodeRecord):
    """A new episode, with its trajectory as an `.npz`, which takes too long to write for a transaction."""

    trajectory: bytes


@dataclass(frozen=True)
class Extraction:
    """Keyframes and object poses of one episode, extracted again."""

    episode_id: str
    keyframes: tuple[KeyframeRecord, ...]
    objects: tuple[ObjectRecord, ...]
    keys: ExtractionKeys


@dataclass(frozen=True, kw_only=True)
class _AskedPrediction:
    """What lists, too, have of a prediction; `error` is None if all went well, `findings` are `Finding.to_json`."""

    task: str
    instruction: str
    model: str
    representation: str
    prompt_format: str
    status: PredictionStatus
    error: str | None
    objects: tuple[ObjectRecord, ...]  # as they were observed
    findings: tuple[JsonObject, ...]  # what deserves a look, causes first


@dataclass(frozen=True, kw_only=True)
class _StoredPrediction(_AskedPrediction):
    """What lists have of a stored one; its outcome is None until somebody records one."""

    id: str
    sequence: int
    created_at: datetime
    outcome_success: bool | None
    outcome_note: str | None

    @property
    def fate(self) -> Fate:
        """`refused`: no actions, so that the robot could not even try."""
        if self.outcome_success is not None:
            return "success" if self.outcome_success else "failure"
        return "unknown" if self.status == "ok" else "refused"


@dataclass(frozen=True, kw_only=True)
class PredictionSummary(_StoredPrediction):
    """A prediction without its prompt and reply."""

    num_demonstrations: int

    @property
    def dangers(self) -> list[str]:
        return [item["code"] for item in self.findings if item["severity"] == "danger"]


@dataclass(frozen=True, kw_only=True)
class PredictionDraft(_AskedPrediction):
    """A new prediction.

    Attributes:
        request: as the caller sent it.
        reply_text: None if the model gave none; `actions` None if the reply had none.
        cameras: with the images that were sent, if any.
        grounding: how the instruction was understood (`Grounded.to_json`).
    """

    request: JsonObject
    demonstration_ids: tuple[str, ...]
    prompt_system: str
    prompt_user: str
    reply_text: str | None
    actions: tuple[JsonObject, ...] | None
    usage: JsonObject  # numbers of tokens
    timings_ms: JsonObject
    grounding: JsonObject
    cameras: tuple[CameraRecord, ...] = ()

    @property
    def tokens(self) -> dict[str, int]:
        return {name: number for name, number in self.usage.items() if name.endswith("_tokens")}


@dataclass(frozen=True, kw_only=True)
class PredictionRecord(PredictionDraft, _StoredPrediction):
    """A stored prediction."""

    outcome_at: datetime | None
