"""Values of bounds of motion that come from elsewhere: each must be a number that a comparison can hold against."""

import math
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

from roboprompt_client.errors import InvalidInputError

Corners = tuple[tuple[float, ...], tuple[float, ...]]


def member(document: object, field: str, name: str) -> Any:  # noqa: ANN401
    """A member of a JSON object.

    Args:
        field: path of the object, empty for the whole document.

    Raises:
        InvalidInputError: if `document` is no object, or has no such member.
    """
    path = f"{field}.{name}".lstrip(".")
    if not isinstance(document, Mapping):
        raise InvalidInputError(field or "limits", f"is {document!r:.80}", "a JSON object")
    if name not in document:
        raise InvalidInputError(path, "is missing", "the bounds of motion in full, as GET /tasks/{name} has them")
    return document[name]


def checked_corners(field: str, low: object, high: object) -> Corners:
    """Opposite corners of a box: (3) finite numbers each, the first below the second on every axis."""
    corners = _point(f"{field}.min", low), _point(f"{field}.max", high)
    if not all(a < b for a, b in zip(*corners, strict=True)):
        raise InvalidInputError(field, f"has min {list(corners[0])} and max {list(corners[1])}", "min below max")
    return corners


def checked_bound(field: str, value: object, most: float = math.inf, *, zero: bool = False) -> float:
    """A finite number above 0.

    Args:
        most: the greatest that is valid.
        zero: whether 0 is valid.
    """
    number = _number(value)
    if number is None or not (number >= 0 if zero else number > 0) or number > most:
        least = "at least 0" if zero else "above 0"
        upper = "" if math.isinf(most) else f" and at most {most:g}"
        raise InvalidInputError(field, f"is {value!r:.80}", f"a finite number {least}{upper}")
    return number


def _point(field: str, value: object) -> tuple[float, ...]:
    items = value if isinstance(value, Sequence) and not isinstance(value, str) else ()
    numbers = [number for item in items if (number := _number(item)) is not None]
    if len(numbers) != 3 or len(items) != 3:
        raise InvalidInputError(field, f"is {value!r:.80}", "3 finite numbers, in metres")
    return tuple(numbers)


def _number(value: object) -> float | None:
    """As a float, if it is a finite number."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None
