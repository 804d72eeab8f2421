"""Answers about predictions."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from app.api.schemas.responses import Bins, FindingOut, ObservedObjectOut


class AnchorOut(BaseModel):
    """The frame that an action is relative to. If the object moves, a robot can move the action with it."""

    object: Annotated[str | None, Field(description="null if the frame is world or start")]
    frame: Annotated[
        Literal["w", "o", "ow", "wo", "world", "start"],
        Field(
            description="w: world axes at the object; o: the object's axes (only its yaw where it stands upright; of a "
            "symmetric object those of its equal rotation that demonstrations are nearest to); "
            "ow: the object's axes for the offset, the world's for the rotation; wo: the reverse; "
            "world: the world frame; start: world axes where the end effector was at first"
        ),
    ]
    toward: Annotated[
        str | None,
        Field(default=None, description="object to which x of the object's axes then points, level, in o and ow"),
    ]
    along: Annotated[
        dict[Literal["x", "y", "z"], str | None],
        Field(
            default={},
            description="world axes along which the offset is from another object, or (null) from the world's origin",
        ),
    ]
    axes: Annotated[
        list[str] | None,
        Field(
            default=None,
            max_length=2,
            description="what turns the offset, where that is other than `frame` says: the axes of an object, or level "
            "axes of which x points from the first object to the second",
        ),
    ]
    hand: Annotated[
        list[str] | None,
        Field(
            default=None,
            max_length=2,
            description="the same of the rotation; empty: it follows where the end effector was at first",
        ),
    ]
    share: Annotated[
        float,
        Field(default=1.0, description="of the way from the object to the other one of `along`, where the origin is"),
    ]
    offset_m: Annotated[list[float], Field(description="(3) from the origin, along these axes")]
    rotation_xyzw: Annotated[list[float], Field(description="(4) from these axes")]
    tolerance_m: Annotated[float, Field(description="spread of the demonstrations: most of them lie within it")]
    tolerance_deg: float


class ActionOut(BaseModel):
    """An end-effector target in the world frame."""

    position: list[float]
    quaternion_xyzw: list[float]
    gripper_open: bool
    bins: Bins
    clamped: bool
    anchor: Annotated[AnchorOut | None, Field(description="null if no demonstrated row corresponds to the action")] = (
        None
    )


class PromptOut(BaseModel):
    """The prompt that the LLM read."""

    system: str
    user: str


class UsageOut(BaseModel):
    """Numbers of tokens. Cached tokens were not evaluated again."""

    prompt_tokens: int
    cached_tokens: int
    completion_tokens: int


class GroundingOut(BaseModel):
    """The object that a phrase of the instruction stands for, and how it was recognized."""

    phrase: str
    object: str
    by: Literal["name", "alias", "color", "relation", "taught"]


class UnderstoodOut(BaseModel):
    """How the instruction was understood."""

    canonical_instruction: Annotated[
        str | None,
        Field(description="the instruction in the prompt: in the form of a demonstrated one, with the objects' names"),
    ]
    grounding: list[GroundingOut]


DemonstrationIds = Annotated[
    list[str],
    Field(description="demonstrations of the prompt; if they have the same rows, the text may show only three of them"),
]


class StepOut(BaseModel):
    """One step: task and instruction for `POST /predict`."""

    task: str
    instruction: Annotated[str, Field(description="in the words of the task's demonstrations")]


class PlanOut(BaseModel):
    """The steps of a sentence, in the order in which the robot does them."""

    steps: list[StepOut]


class AskedOut(UnderstoodOut):
    """What a prediction and a dry run have in common."""

    task: str
    objects: Annotated[list[ObservedObjectOut], Field(description="observed objects, in the task's order")]
    model: str
    representation: str
    prompt_format: str
    demonstration_ids: DemonstrationIds
    prompt: PromptOut
    prefix_hash: Annotated[str, Field(description="digest of the prompt without the query, which an LLM's cache keeps")]
    timings_ms: dict[str, float]
    findings: Annotated[list[FindingOut], Field(description="doubts to look at before the robot moves")] = []


class PredictionOut(AskedOut):
    """Actions for the robot, and the prompt and reply that they come from."""

    id: str
    actions: list[ActionOut]
    reply_text: str
    usage: UsageOut


class DryRunOut(AskedOut):
    """The prompt that an LLM would read."""

    id: None = None
    grammar: str | None


class OutcomeOut(BaseModel):
    """Whether the robot succeeded."""

    success: bool
    note: str | None
    recorded_at: datetime


class StoredPrediction(UnderstoodOut):
    """A recorded prediction, which may have failed."""

    id: str
    task: str
    instruction: str
    status: Literal["ok", "parse_error", "unsafe_action", "unsupported", "model_error"]
    error: str | None
    model: str
    representation: str
    prompt_format: str
    demonstration_ids: DemonstrationIds
    prompt: PromptOut
    reply_text: str | None
    actions: list[ActionOut] | None
    objects: list[ObservedObjectOut]
    cameras: Annotated[list[str], Field(description="names of the cameras whose images were sent")]
    usage: dict[str, int]
    timings_ms: dict[str, float]
    findings: Annotated[list[FindingOut], Field(description="doubts, causes before effects")]
    request: dict[str, Any]
    outcome: OutcomeOut | None
    created_at: datetime


class PredictionPage(BaseModel):
    """Predictions, newest first."""

    predictions: list[StoredPrediction]
    next_cursor: int | None
