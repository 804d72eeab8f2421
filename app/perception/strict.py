"""Numbers and truth values of JSON that are what they say they are: pydantic would take `true` for 1 and "5" for 5."""

from typing import Annotated

from pydantic import BeforeValidator, Field, Strict
from pydantic_core import PydanticKnownError

from roboprompt_client.types.arrays import MAX_M


def _no_text(value: object) -> object:
    if isinstance(value, bool | str):
        raise PydanticKnownError("int_type")
    return value


Number = Annotated[float, Strict()]
# Positions and lengths in the world frame: what is farther is no robot's, and its square would have no number.
Meters = Annotated[Number, Field(ge=-MAX_M, le=MAX_M)]
Truth = Annotated[bool, Strict()]
# For whole numbers; 10.0 is the same number in JSON, and some languages write every number so.
WHOLE = BeforeValidator(_no_text)
