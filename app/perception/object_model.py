"""The base of all object models: strict JSON types, the estimator's name as a tag, errors that name a field."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, ConfigDict, Field, Strict
from pydantic_core import PydanticKnownError

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import MAX_M

MIN_CONFIDENCE = 0.5  # below this a pose is refused, unless the model says otherwise


def _no_text(value: object) -> object:
    if isinstance(value, bool | str):
        raise PydanticKnownError("int_type")
    return value


# Strict types of JSON values: by default pydantic accepts `true` as 1 and "5" as 5.
Number = Annotated[float, Strict()]
# Positions and lengths in the world frame, bounded so that their squares do not overflow.
Meters = Annotated[Number, Field(ge=-MAX_M, le=MAX_M)]
Truth = Annotated[bool, Strict()]
# For whole numbers. 10.0 is accepted: JSON does not distinguish it, and some languages write all numbers so.
WHOLE = BeforeValidator(_no_text)
Length = Annotated[Number, Field(ge=1e-4, le=100, description="meters")]
Share = Annotated[Number, Field(ge=0, le=1)]
Confidence = Annotated[
    Number, Field(ge=0, le=1, description="a number in 0..1; a pose that is less certain is refused")
]


class ObjectModelError(InvalidInputError):
    """The model of an object is missing or wrong, or cannot be learned.

    Args:
        name: of the object.
        within: path of the value in its model; empty for the whole.
    """

    def __init__(self, name: str, message: str, valid: str | None = None, *, within: str = "") -> None:
        super().__init__(".".join(filter(None, (f"object_models[{name}]", within))), message, valid)
        self.name = name
        self.within = within

    def __reduce__(self) -> tuple[Any, ...]:
        """See `InvalidInputError`."""
        return partial(type(self), within=self.within), (self.name, self.message, self.valid)


class Checked:
    """A dataclass whose JSON pydantic validates by its field types; unknown fields are refused."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", allow_inf_nan=False)


@dataclass(frozen=True)
class ObjectModel(Checked):
    """What an estimator knows of an object before it sees it.

    Fields are plain values and tuples, so that models compare by value.

    Attributes:
        estimator: the estimator that reads such a model; also the tag in JSON.
    """

    estimator: str = field(kw_only=True)

    def as_json(self) -> dict[str, Any]:
        """Return all fields, the tag first; `app.perception.models.model_from_json` is the inverse."""
        return {name: _plain(value) for name, value in asdict(self).items()}


def one_of(name: str, value: object, allowed: Iterable[Any]) -> None:
    """Raise InvalidInputError unless `value` is among `allowed`."""
    options = tuple(allowed)
    if value not in options:
        raise InvalidInputError(name, f"is {value!r}", ", ".join(map(str, options)))


def within(where: str, error: InvalidInputError) -> InvalidInputError:
    """Return the error with its field prefixed by `where`: `size_m` becomes `object_models[cube].size_m`."""
    return InvalidInputError(".".join(part for part in (where, error.field) if part), error.message, error.valid)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
