"""Answers about a check of a task's demonstrations."""

from typing import Annotated

from pydantic import BaseModel, Field

from app.api.schemas.responses import FindingOut


class RowCheckOut(BaseModel):
    """A row of a plan: what it follows, and how sure it is."""

    follows: Annotated[str, Field(description="the objects that it is relative to, or the world")]
    gripper_open: bool
    switches: Annotated[bool, Field(description="whether the gripper opens or closes at this row")]
    scatter_cm: Annotated[float, Field(description="scale of a further demonstration along the least certain axis")]
    scatter_deg: float


class LeastProbableOut(BaseModel):
    """The coordinate of a demonstration, of its acts or its scene, that the others make least probable."""

    coordinate: str
    value: Annotated[float, Field(description="m or rad")]
    low: Annotated[float, Field(description="of the usual range")]
    high: float
    p: Annotated[float, Field(description="how often chance alone is as far off")]


class EpisodeCheckOut(BaseModel):
    """A demonstration, held against the others of its plan."""

    id: str
    instruction: str
    least_probable: Annotated[LeastProbableOut | None, Field(description="null of fewer than three demonstrations")]


class PlanCheckOut(BaseModel):
    """One way of carrying out an instruction."""

    instructions: list[str]
    when: Annotated[list[str], Field(description="the scenes that call for it; empty: all that call for no other")]
    used: Annotated[bool, Field(description="whether some scene calls for it")]
    rows: list[RowCheckOut]
    episodes: list[EpisodeCheckOut]


class TaskCheckOut(BaseModel):
    """What a task's demonstrations share, and each of them held against the others, before a robot moves."""

    task: str
    num_episodes: int
    num_checked: Annotated[int, Field(description="of more than 50, those whose scenes lie farthest apart")]
    findings: Annotated[list[FindingOut], Field(description="as uploads and predictions have them, causes first")]
    plans: list[PlanCheckOut]
