"""What the service answers. Routes build these documents themselves; a test holds them against the models.

Every answer carries its doubts in one form.
"""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.services.task_settings import TaskSettings

Bins = Annotated[list[int], Field(description="x y z (0..99), roll pitch yaw (0..71), gripper (1 = open)")]


class FindingOut(BaseModel):
    """A doubt: what deserves a look, and the numbers behind it as further members."""

    model_config = ConfigDict(extra="allow")

    code: str
    severity: Literal["info", "warning", "danger"]
    message: str
    where: Annotated[str, Field(description="path of what it is about; empty for the whole")]


class KeyframeOut(BaseModel):
    """An action of an episode, at a keyframe."""

    index: int
    position: list[float]
    quaternion_xyzw: list[float]
    gripper_open: bool
    bins: Bins
    clamped: Annotated[bool, Field(description="the position lies outside the workspace; its bins are at the edge")]


class ObservedObjectOut(BaseModel):
    """An object's pose as it was estimated."""

    name: str
    position: list[float]
    quaternion_xyzw: list[float] | None
    estimator: str
    cameras: Annotated[list[str], Field(description="in whose images it was found")]
    confidence: Annotated[float, Field(ge=0, le=1, description="as the estimator judges its own result")]
    reason: Annotated[str, Field(description="what lowered the confidence or deserves a look; empty if nothing")]


class ObjectOut(ObservedObjectOut):
    """An object of an episode."""

    bins: Annotated[list[int], Field(description="three, or six where the rotation is known")]


class ListedEpisode(BaseModel):
    """A stored episode and what was extracted from it; the texts are in the paper's representation."""

    id: str
    task: str
    instruction: str
    num_frames: int
    control_frequency_hz: float
    keyframes: list[KeyframeOut]
    objects: list[ObjectOut]
    cameras: list[str]
    prediction_id: Annotated[str | None, Field(description="of the prediction that the robot carried out here")]
    left_out: Annotated[bool, Field(description="kept, but shown in no prompt")]
    note: str
    uploaded_instruction: Annotated[str | None, Field(description="null unless the instruction was corrected since")]
    observation_text: str
    actions_text: str
    created_at: datetime


class EpisodeOut(ListedEpisode):
    """An episode with what else was uploaded."""

    extra: dict[str, Any]


class UploadedEpisodeOut(EpisodeOut):
    """An episode that was just uploaded."""

    findings: Annotated[list[FindingOut], Field(description="what in the recording deserves a look")]


class UploadOut(BaseModel):
    """What an upload made."""

    episode_id: str


class EpisodePage(BaseModel):
    """Episodes, newest first, without their `extra`; `next_cursor` continues the list, null at its end."""

    episodes: list[ListedEpisode]
    next_cursor: int | None


class TaskOut(TaskSettings):
    """A task: its settings, and what is stored of it."""

    name: str
    version: int
    object_names: list[str] | None
    num_episodes: int
    note: Annotated[str, Field(description="what the settings do not reach; empty if nothing, and in lists")] = ""


class TaskList(BaseModel):
    """Every task."""

    tasks: list[TaskOut]


class StandingOut(BaseModel):
    """How predictions ended. Rate and interval are of those whose outcome a robot reported."""

    predictions: int
    errors: Annotated[int, Field(description="without actions: the LLM failed, or its reply was not valid")]
    successes: int
    failures: int
    success_rate: Annotated[float | None, Field(description="null where no outcome was reported")]
    interval: Annotated[tuple[float, float], Field(description="Wilson's 95 % interval of the true success rate")]


class ConfigurationOut(StandingOut):
    """A way to ask, and how robots fared with it."""

    id: Annotated[str, Field(description="for `compare`")]
    model: str
    representation: str
    prompt_format: str
    selection: Annotated[str | None, Field(description="null where the request named its episodes")]
    num_demonstrations: int
    num_samples: int
    is_yardstick: Annotated[bool, Field(description="replies are computed without an LLM, to hold models against")]
    llm_ms: Annotated[float | None, Field(description="what the median of the latest replies took")]
    tokens: Annotated[tuple[float, float] | None, Field(description="medians of the latest prompts and replies")]


class ComparisonOut(BaseModel):
    """Two configurations by their outcomes, the k-th of one with the k-th of the other."""

    one: str
    other: str
    one_alone: Annotated[int, Field(description="pairs in which only the one succeeded")]
    other_alone: int
    alike: int
    difference: Annotated[
        tuple[float, float],
        Field(description="95 % bounds of the one's rate minus the other's, which hold at every moment at once"),
    ]
    evidence: Annotated[float, Field(description="against equal rates; from 20 on they differ, with 95 % confidence")]
    may_stop: bool
    pairs_until_decided: Annotated[
        int | None, Field(description="about how many more decide it if it goes on so; null where they may never")
    ]


class TaskStatsOut(StandingOut):
    """A task's predictions together, and by configuration, the surest success first."""

    task: str
    configurations: list[ConfigurationOut]
    comparisons: list[ComparisonOut]


class RunOut(BaseModel):
    """A robot that carries something out; `state` is what it said last."""

    id: str
    task: str
    state: dict[str, Any]
    stop: Annotated[bool, Field(description="whether somebody stopped it")]
    created_at: datetime
    heard_at: datetime


class RunList(BaseModel):
    """The robots that were heard of within a minute, the longest under way first."""

    runs: list[RunOut]


class RunAnswer(BaseModel):
    """Whether the robot shall stop."""

    stop: Annotated[bool, Field(description="hold still at once, and carry out nothing more of this run")]


class JobOut(BaseModel):
    """The re-extraction of a task's episodes with changed settings, which hold when it is done."""

    id: str
    task: str
    changes: dict[str, Any]
    status: Literal["queued", "running", "done", "failed"]
    num_episodes: int
    num_extracted: int
    error: str | None
    created_at: datetime
    finished_at: datetime | None


class JobPage(BaseModel):
    """Jobs, newest first."""

    jobs: list[JobOut]
    next_cursor: int | None


class ModelOut(BaseModel):
    """An LLM that can be asked."""

    name: str
    available: bool
    reason: Annotated[str | None, Field(description="what to install or set, where it is not available")]
    style: Literal["completion", "chat"]
    grammar: bool
    representation: str
    prompt_format: str
    system_prompt: str
    description: str
    timeout_s: Annotated[float, Field(description="the deadline of a request that names none")]
    reading_s: Annotated[float, Field(description="what that is longer for each 1,000 characters of the prompt")]
    default: bool


class ModelList(BaseModel):
    """Every LLM that the service knows."""

    models: list[ModelOut]


class Health(BaseModel):
    """Whether the service lives, or is ready, and what it waits for."""

    status: Literal["ok", "starting"]
    checks: dict[str, str]


class FieldError(BaseModel):
    """One thing that is wrong with a request."""

    field: str
    message: str
    valid: str | None = None


class Problem(BaseModel):
    """An error as RFC 9457 describes it."""

    type: str
    title: str
    status: int
    detail: str
    errors: list[FieldError] = []
