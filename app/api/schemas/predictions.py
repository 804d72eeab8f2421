"""What the service answers about predictions and about a check of a task's demonstrations."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from app.api.schemas.responses import Bins, FindingOut, ObservedObjectOut
from app.pipeline.keyframes import Rule

Errors = Annotated[list[float], Field(description="of each row; empty where there is nothing to compare")]


class RowCheckOut(BaseModel):
    """A row of a plan: each demonstration's action held against where the others predict it."""

    objects: Annotated[list[str], Field(description="which the row follows; empty if it follows none")]
    frame: Literal["w", "o", "ow", "wo", "world", "start"]
    gripper_open: bool
    switches: Annotated[bool, Field(description="whether the gripper opens or closes there")]
    error_cm: Annotated[float | None, Field(description="of the median demonstration; null without others")]
    error_deg: float | None
    worst_cm: float | None
    worst_deg: float | None
    worst_episode_id: str | None
    varies_cm: Annotated[float, Field(description="how far the row is from its usual place in the world")]
    varies_deg: float


class EpisodeCheckOut(BaseModel):
    """A demonstration, predicted from the others of its plan."""

    id: str
    instruction: str
    manner: Annotated[
        Literal["rests", "hesitates", "flows"], Field(description="whether the recording rests at its keyframes")
    ]
    error_cm: Errors
    error_deg: Errors
    path_cm: Annotated[float, Field(description="how far the recorded hand is at most from the keyframes' way")]
    unlike_others: bool


class PlanCheckOut(BaseModel):
    """Demonstrations that ask for the same and do it in the same rows."""

    instructions: list[str]
    shown: Annotated[bool, Field(description="whether prompts show the plan; they leave a rare one out")]
    rows: list[RowCheckOut]
    episodes: list[EpisodeCheckOut]


class ReplyCheckOut(BaseModel):
    """What the model replied for a demonstration that it was not shown."""

    episode_id: str
    num_actions: Annotated[int | None, Field(description="null where the reply gave none")]
    error_cm: Errors
    error_deg: Errors
    problem: Annotated[str | None, Field(description="why the actions cannot be compared")]
    wrong: Annotated[bool, Field(description="whether a robot that did as it says would do something else")]


class TaskCheckOut(BaseModel):
    """A task's demonstrations, each predicted from the others before a robot moves."""

    task: str
    rule: Annotated[Rule, Field(description="of the keyframes")]
    num_episodes: int
    num_checked: Annotated[int, Field(description="the task's first")]
    findings: Annotated[list[FindingOut], Field(description="what would go wrong and what to do, the severest first")]
    plans: Annotated[list[PlanCheckOut], Field(description="those with most demonstrations first")]
    unlike_episode_ids: Annotated[list[str], Field(description="of demonstrations that do not do as the others")]
    model: Annotated[str | None, Field(description="that was asked; null if none was")]
    replies: Annotated[list[ReplyCheckOut], Field(description="of that model; empty without one")]


class AnchorOut(BaseModel):
    """What an action is relative to: the robot that sees the object move can move the action with it."""

    object: Annotated[str | None, Field(description="null for the frames world and start")]
    frame: Annotated[
        Literal["w", "o", "ow", "wo", "world", "start"],
        Field(
            description="w: world axes at the object; o: the object's axes (only its yaw where it stands upright); "
            "ow: the object's axes for the offset, the world's for the rotation; wo: the reverse; "
            "world: the world frame; start: world axes where the end effector was at first"
        ),
    ]
    offset_m: Annotated[list[float], Field(description="(3) from the origin, along these axes")]
    rotation_xyzw: Annotated[list[float], Field(description="(4) from these axes")]
    tolerance_m: Annotated[float, Field(description="within which most demonstrations lie")]
    tolerance_deg: float


class ActionOut(BaseModel):
    """An end-effector target in the world frame."""

    position: list[float]
    quaternion_xyzw: list[float]
    gripper_open: bool
    bins: Bins
    clamped: bool
    anchor: Annotated[AnchorOut | None, Field(description="null where no demonstrated row is known")] = None


class PromptOut(BaseModel):
    """What the LLM read."""

    system: str
    user: str


class UsageOut(BaseModel):
    """Tokens; cached ones were not evaluated again."""

    prompt_tokens: int
    cached_tokens: int
    completion_tokens: int


class SampleOut(BaseModel):
    """One of several replies to a question."""

    seed: int
    reply_text: str | None
    num_actions: Annotated[int | None, Field(description="null where the reply is not a list of valid actions")]
    used: Annotated[bool, Field(description="whether it goes the way of the reply that counts")]
    error: str | None


class SamplesOut(BaseModel):
    """Several replies to a question; the actions are those of the one that most are like."""

    asked: int
    used: int
    replies: list[SampleOut]


Samples = Annotated[SamplesOut | None, Field(description="null where one reply was asked for")]


class GroundingOut(BaseModel):
    """What a phrase of the instruction was taken for."""

    phrase: str
    object: str
    by: Literal["name", "alias", "spelling", "color", "relation", "taught", "llm"]


class UnderstoodOut(BaseModel):
    """How the instruction was understood."""

    canonical_instruction: Annotated[
        str | None, Field(description="what prompts say: the objects by their names, in the form of a taught one")
    ]
    grounding: list[GroundingOut]


DemonstrationIds = Annotated[
    list[str],
    Field(description="that the prompt was made of; rows in which they agree may be shown of three of them only"),
]
ShownPrompt = Annotated[
    PromptOut | None, Field(description="null for a key that may not read the demonstrations in it (scope read)")
]


class StepOut(BaseModel):
    """What `POST /predict` is to be asked for next."""

    task: str
    instruction: Annotated[str, Field(description="in the words of the task")]


class PlanOut(BaseModel):
    """The steps of a sentence, in the order in which they are done."""

    steps: list[StepOut]


class PredictionOut(UnderstoodOut):
    """Actions for the robot, and where they come from."""

    id: str
    task: str
    actions: list[ActionOut]
    objects: Annotated[list[ObservedObjectOut], Field(description="as they were observed, in the task's order")]
    model: str
    representation: str
    prompt_format: str
    demonstration_ids: DemonstrationIds
    prompt: ShownPrompt
    prefix_hash: Annotated[str, Field(description="equal for equal prompts up to the query: what an LLM's cache keeps")]
    reply_text: str
    usage: UsageOut
    timings_ms: dict[str, float]
    samples: Samples = None
    findings: Annotated[list[FindingOut], Field(description="what deserves a look before the robot moves")] = []


class DryRunOut(UnderstoodOut):
    """The prompt as an LLM would read it."""

    id: None = None
    task: str
    objects: list[ObservedObjectOut]
    model: str
    representation: str
    prompt_format: str
    demonstration_ids: DemonstrationIds
    prompt: PromptOut
    prefix_hash: Annotated[str, Field(description="equal for equal prompts up to the query: what an LLM's cache keeps")]
    grammar: str | None
    findings: list[FindingOut] = []
    timings_ms: dict[str, float]


class OutcomeOut(BaseModel):
    """How the robot fared."""

    success: bool
    note: str | None
    recorded_at: datetime


class StoredPrediction(UnderstoodOut):
    """A prediction as it was recorded, also where it failed."""

    id: str
    task: str
    instruction: str
    status: Literal["ok", "parse_error", "unsafe_action", "unsupported", "model_error"]
    error: str | None
    model: str
    representation: str
    prompt_format: str
    demonstration_ids: DemonstrationIds
    prompt: ShownPrompt
    reply_text: str | None
    actions: list[ActionOut] | None
    objects: list[ObservedObjectOut]
    cameras: Annotated[list[str], Field(description="whose images were sent")]
    usage: dict[str, int]
    timings_ms: dict[str, float]
    samples: Samples = None
    findings: Annotated[list[FindingOut], Field(description="what deserves a look, causes first")]
    request: dict[str, Any]
    outcome: OutcomeOut | None
    key_id: Annotated[str | None, Field(description="of the API key that asked for it, where keys are required")] = None
    created_at: datetime


class PredictionPage(BaseModel):
    """Predictions, newest first."""

    predictions: list[StoredPrediction]
    next_cursor: int | None
