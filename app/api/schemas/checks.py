"""Answers about a check of a task's demonstrations."""

from typing import Annotated, Literal

from pydantic import BaseModel, Field

from app.api.schemas.responses import FindingOut
from app.pipeline.keyframes import RuleName

Errors = Annotated[list[float], Field(description="one number for each row; empty if there is nothing to compare with")]


class RowCheckOut(BaseModel):
    """A row of a plan: how well each demonstration's action is predicted from the other demonstrations."""

    objects: Annotated[list[str], Field(description="objects that the row is relative to; empty if none")]
    frame: Literal["w", "o", "ow", "wo", "world", "start"]
    gripper_open: bool
    switches: Annotated[bool, Field(description="whether the gripper opens or closes at this row")]
    error_cm: Annotated[float | None, Field(description="median over the demonstrations; null if there is only one")]
    error_deg: float | None
    worst_cm: float | None
    worst_deg: float | None
    worst_episode_id: str | None
    varies_cm: Annotated[float, Field(description="how much the row's position varies in the world frame")]
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
    path_cm: Annotated[
        float, Field(description="largest distance of the recorded path from the straight path through the keyframes")
    ]
    unlike_others: bool


class PlanCheckOut(BaseModel):
    """Demonstrations of the same instruction with the same rows."""

    instructions: list[str]
    shown: Annotated[bool, Field(description="whether prompts show this plan; a rare plan is left out")]
    rows: list[RowCheckOut]
    episodes: list[EpisodeCheckOut]


class ReplyCheckOut(BaseModel):
    """The model's reply for a demonstration that it was not shown."""

    episode_id: str
    num_actions: Annotated[int | None, Field(description="null if the reply has no valid actions")]
    error_cm: Errors
    error_deg: Errors
    problem: Annotated[str | None, Field(description="why the actions cannot be compared")]
    wrong: Annotated[
        bool, Field(description="whether a robot that follows the reply would not do what the demonstration does")
    ]


class TaskCheckOut(BaseModel):
    """A task's demonstrations, each predicted from the others before a robot moves."""

    task: str
    rule: Annotated[RuleName, Field(description="rule by which keyframes were found")]
    num_episodes: int
    num_checked: Annotated[int, Field(description="number of demonstrations that were checked, the task's first")]
    findings: Annotated[
        list[FindingOut], Field(description="what would go wrong and what to do about it, most severe first")
    ]
    plans: Annotated[list[PlanCheckOut], Field(description="in order of their number of demonstrations, largest first")]
    unlike_episode_ids: Annotated[
        list[str], Field(description="ids of outliers: demonstrations that differ from the others of their plan")
    ]
    model: Annotated[str | None, Field(description="LLM that was asked; null if none was")]
    replies: Annotated[list[ReplyCheckOut], Field(description="replies of that LLM; empty if none was asked")]
