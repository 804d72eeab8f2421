"""Doubts, as every answer carries them."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class FindingOut(BaseModel):
    """A doubt: what deserves a look, and the numbers behind it as further members."""

    model_config = ConfigDict(extra="allow")

    code: str
    severity: Literal["info", "warning", "danger"]
    message: str
    where: Annotated[str, Field(description="path of what it is about; empty for the whole")]
