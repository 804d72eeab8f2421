"""What a check of a task's demonstrations answers."""

from typing import Annotated, Literal

from pydantic import BaseModel, Field

from app.api.schemas.findings import FindingOut
from app.pipeline.keyframes import Rule

Errors = Annotated[list[float], Field(description="of each row; empty where there is nothing to compare")]


class RowCheckOut(BaseModel):
    """A row of a plan: each demonstration's action held against where the others predict it."""

    objects: Annotated[list[str], Field(description="which the row follows; empty if it follows none")]
    frame: Literal["w", "o", "world", "start"]
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
