"""What every kind of object model shares: a tag that names its estimator, its JSON, and checks that name a field."""

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, field, fields
from typing import Any, Self

from roboprompt_client.errors import InvalidInputError

MIN_CONFIDENCE = 0.5  # below this a pose is refused, unless the model says otherwise


@dataclass(frozen=True)
class ObjectModel:
    """What is known of an object beforehand. Fields are plain values and tuples, so that models compare by value.

    Attributes:
        estimator: the estimator that reads such a model; also the tag in JSON.
    """

    estimator: str = field(init=False)

    def as_json(self) -> dict[str, Any]:
        """Every field, the tag first; `app.perception.models.model_from_json` is the inverse."""
        return {name: _plain(value) for name, value in asdict(self).items()}

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> Self:
        """A model of this kind from its fields, without or with the tag.

        Raises:
            InvalidInputError: naming the field relative to the model, e.g. ``size_m``.
        """
        return cls(**checked_fields(cls, value))


def checked_fields(kind: type[Any], value: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments for `kind`, a dataclass, from a JSON object; the fields that are not arguments are left out.

    Raises:
        InvalidInputError: for a field that is missing or unknown; says which there are.
    """
    if not isinstance(value, Mapping):
        raise InvalidInputError("", f"is {value!r}", f"an object with {_listed(kind)}")
    known = {item.name: item for item in fields(kind)}
    for name in value:
        if name not in known:
            raise InvalidInputError(str(name), "is not a field", _listed(kind))
    for name, item in known.items():
        if item.init and name not in value and item.default is MISSING and item.default_factory is MISSING:
            raise InvalidInputError(name, "is missing", _listed(kind))
    return {name: value[name] for name, item in known.items() if item.init and name in value}


def numbers(name: str, value: object, count: int, *, valid: str, low: float = -math.inf) -> tuple[float, ...]:
    """`value` as `count` finite numbers above `low`.

    Raises:
        InvalidInputError: naming the field, its value and what is valid.
    """
    items = tuple(value) if isinstance(value, Sequence) and not isinstance(value, str) else ()
    if len(items) != count or not all(_is_number(item) and item > low for item in items):
        raise InvalidInputError(name, f"is {value!r:.80}", valid)
    return tuple(float(item) for item in items)


def number(name: str, value: object, *, valid: str, low: float = -math.inf, high: float = math.inf) -> float:
    """`value` as a finite number from `low` to `high`, both included; raises InvalidInputError like `numbers`."""
    if not (_is_number(value) and low <= value <= high):  # type: ignore[operator]
        raise InvalidInputError(name, f"is {value!r:.80}", valid)
    return float(value)  # type: ignore[arg-type]


def one_of(name: str, value: object, allowed: Iterable[Any]) -> None:
    """Raises InvalidInputError unless `value` is among `allowed`."""
    options = tuple(allowed)
    if value not in options:
        raise InvalidInputError(name, f"is {value!r}", ", ".join(map(str, options)))


def within(where: str, error: InvalidInputError) -> InvalidInputError:
    """The same refusal with its field named from further out: `size_m` in `object_models[cube]`."""
    return InvalidInputError(".".join(part for part in (where, error.field) if part), error.message, error.valid)


def _is_number(value: object) -> bool:
    # A comparison, unlike math.isfinite, bears integers that are beyond any float.
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _listed(kind: type[Any]) -> str:
    return ", ".join(item.name for item in fields(kind))


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
