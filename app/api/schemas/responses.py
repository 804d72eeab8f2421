"""Answers about episodes and models.

Routes build these documents themselves (`app.api.documents`); a test compares them with these models.
"""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Bins = Annotated[list[int], Field(description="x y z (0..99), roll pitch yaw (0..71), gripper (1 = open)")]


class FindingOut(BaseModel):
    """A doubt about a recording, a scene or actions. Further members have the numbers behind it."""

    model_config = ConfigDict(extra="allow")

    code: str
    severity: Literal["info", "warning", "danger"]
    message: str
    where: Annotated[str, Field(description="path of the field that it is about; empty if it is about all of it")]


class KeyframeOut(BaseModel):
    """An action of an episode, at a keyframe."""

    index: int
    position: list[float]
    quaternion_xyzw: list[float]
    gripper_open: bool
    bins: Bins
    clamped: Annotated[
        bool, Field(description="true: the position lies outside the workspace, and its bins are at the edge")
    ]


class PoseOut(BaseModel):
    """The estimated pose of an object in the world frame."""

    name: str
    position: list[float]
    quaternion_xyzw: list[float] | None
    cameras: Annotated[list[str], Field(description="names of the cameras that see it")]
    confidence: Annotated[float, Field(ge=0, le=1, description="the estimator's confidence in its result")]
    reason: Annotated[str, Field(description="what lowered the confidence; empty if nothing")]


class ObservedObjectOut(PoseOut):
    """The estimated pose of an object, and the estimator that found it."""

    estimator: str


class ObjectOut(ObservedObjectOut):
    """An object of an episode."""

    bins: Annotated[
        list[int], Field(description="three bins of the position, and three of the rotation if it is known")
    ]


class ListedEpisode(BaseModel):
    """A stored episode, its keyframes and object poses; the texts have the paper's representation."""

    id: str
    task: str
    instruction: str
    num_frames: int
    control_frequency_hz: float
    keyframes: list[KeyframeOut]
    objects: list[ObjectOut]
    cameras: list[str]
    prediction_id: Annotated[
        str | None, Field(description="id of the prediction that the robot carried out in this episode")
    ]
    corrects: Annotated[str | None, Field(description="id of the failed prediction that this episode corrects")]
    left_out: Annotated[bool, Field(description="true: the episode is kept, but no prompt shows it")]
    note: str
    uploaded_instruction: Annotated[
        str | None, Field(description="instruction of the upload, if it was corrected since; else null")
    ]
    observation_text: str
    actions_text: str
    created_at: datetime


class EpisodeOut(ListedEpisode):
    """An episode with its findings and the `extra` of its upload."""

    extra: dict[str, Any]
    findings: Annotated[list[FindingOut], Field(description="doubts about the recording")]


class EpisodePage(BaseModel):
    """Episodes, newest first, without their `extra`; `next_cursor` continues the list, null at its end."""

    episodes: list[ListedEpisode]
    next_cursor: int | None


class ModelOut(BaseModel):
    """An LLM that can be asked."""

    name: str
    available: bool
    reason: Annotated[str | None, Field(description="if it is not available: what to install or set")]
    style: Literal["completion", "chat"]
    grammar: bool
    representation: str
    prompt_format: str
    system_prompt: str
    description: str
    timeout_s: Annotated[float, Field(description="default timeout of a request")]
    reading_s: Annotated[float, Field(description="added to the timeout for each 1,000 characters of the prompt")]
    default: bool


class ModelList(BaseModel):
    """Every LLM that the service knows."""

    models: list[ModelOut]


class Health(BaseModel):
    """Whether the service runs or is ready, and what it waits for."""

    status: Literal["ok", "starting"]
    checks: dict[str, str]


class FieldError(BaseModel):
    """An error of one field of a request."""

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
