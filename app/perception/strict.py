"""Strict types of JSON values: by default pydantic accepts `true` as 1 and "5" as 5."""

from typing import Annotated

from pydantic import BeforeValidator, Field, Strict
from pydantic_core import PydanticKnownError

from roboprompt_client.types.arrays import MAX_M


def _no_text(value: object) -> object:
    if isinstance(value, bool | str):
        raise PydanticKnownError("int_type")
    return value


Number = Annotated[float, Strict()]
# Positions and lengths in the world frame, bounded so that their squares do not overflow.
Meters = Annotated[Number, Field(ge=-MAX_M, le=MAX_M)]
Truth = Annotated[bool, Strict()]
# For whole numbers. 10.0 is accepted: JSON does not distinguish it, and some languages write all numbers so.
WHOLE = BeforeValidator(_no_text)
