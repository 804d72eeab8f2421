"""What programs compute, within bounds: arithmetic, comparisons, sequences, plain functions; checks of arguments."""

import ast
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from app.evaluation.baselines.voxposer.program.syntax import MAX_NUMBER
from app.evaluation.baselines.voxposer.program.voxels import AXES, SIZE

MAX_ITEMS = 10_000  # of a sequence
MAX_CM = 1_000.0
SCALARS = (bool, int, float, str, type(None))
ARITHMETIC: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
}
COMPARISONS: Mapping[type[ast.AST], Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
    ast.In: lambda item, items: item in items,
    ast.NotIn: lambda item, items: item not in items,
}


class CommandError(Exception):
    """A command that cannot be carried out as it was called."""


def number(value: object) -> Any:  # noqa: ANN401
    """`value`, if it is a number; raises CommandError."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise CommandError("arithmetic takes numbers only")
    return value


def computed(kind: type[ast.AST], left: object, right: object) -> object:
    """The result of a binary operator; raises CommandError for what is not a number or too large."""
    result = ARITHMETIC[kind](number(left), number(right))
    if not abs(result) <= MAX_NUMBER:
        raise CommandError(f"a number is beyond {MAX_NUMBER:g}")
    return result


def scalar(value: object) -> Any:  # noqa: ANN401
    """`value`, if it can be compared at once; raises CommandError."""
    if not isinstance(value, SCALARS):
        raise CommandError("only numbers and texts can be compared")
    return value


def comparable(comparison: ast.cmpop, value: object) -> Any:  # noqa: ANN401
    """The right side of a comparison; raises CommandError."""
    if isinstance(comparison, ast.In | ast.NotIn) and not isinstance(value, str):
        return [scalar(item) for item in items(value)]
    return scalar(value)


def items(value: object) -> Sequence[object]:
    """`value`, if it is a sequence of bounded length; raises CommandError."""
    if not isinstance(value, list | tuple | range):
        raise CommandError("is no sequence")
    if len(value) > MAX_ITEMS:
        raise CommandError(f"a sequence has {len(value)} items (valid: at most {MAX_ITEMS})")
    return value


def finite(value: object, what: str) -> float:
    """`value` as a number; raises CommandError, as the others here do."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise CommandError(f"{what} is a number, not {type(value).__name__}")
    return value


def length_cm(value: object) -> float:
    """A length in cm."""
    if abs(length := finite(value, "a length in cm")) > MAX_CM:
        raise CommandError(f"a length is {length:g} cm (valid: at most {MAX_CM:g})")
    return length


def axis_number(value: object) -> int:
    """The number of a named axis."""
    if value not in AXES:
        raise CommandError(f"there is no such axis (valid: {', '.join(map(repr, AXES))})")
    return AXES.index(str(value))


def is_index(value: object) -> bool:
    """Whether `value` is the number of a voxel along an axis."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < SIZE


def span(part: object) -> tuple[int, int]:
    """The voxels along one axis that an index means."""
    if isinstance(part, slice) and part.step in (None, 1):
        first, last, _ = part.indices(SIZE)
        if first < last:
            return first, last
    elif isinstance(part, int) and is_index(part):
        return part, part + 1
    raise CommandError(f"an index of a map is a whole number 0..{SIZE - 1} or a slice of them")


def map_value(kind: str, value: object) -> object:
    """`value`, if a map of that kind holds such values."""
    if kind == "rotation":
        if not (isinstance(value, tuple) and len(value) == 4):
            raise CommandError("a rotation map holds quaternions (valid: pointing_down(yaw_deg))")
        x, y, z, w = (finite(part, "a part of a quaternion") for part in value)
        if abs(math.hypot(x, y, z, w) - 1) > 1e-3:
            raise CommandError("a quaternion of a rotation map is not of length 1")
        return (x, y, z, w)
    number = finite(value, f"a value of the {kind} map")
    if kind == "gripper" and number not in (0, 1):
        raise CommandError(f"a gripper map holds {number:g} (valid: 1 open, 0 closed)")
    if kind == "velocity" and not 0 < number <= 1:
        raise CommandError(f"a velocity map holds {number:g} (valid: above 0, up to 1, the usual speed)")
    if kind in ("affordance", "avoidance") and not 0 <= number <= 1:
        raise CommandError(f"an {kind} map holds {number:g} (valid: 0 to 1)")
    return number


def _scalars(values: Sequence[object]) -> list[float]:
    items = values[0] if len(values) == 1 and isinstance(values[0], list | tuple | range) else values
    if not isinstance(items, list | tuple | range) or not items:
        raise CommandError("takes at least one number")
    return [finite(item, "each item") for item in items]


def _sequence(value: object) -> Sequence[object]:
    if not isinstance(value, list | tuple | range):
        raise CommandError("takes a sequence")
    return value


def _range(*ends: object) -> range:
    numbers = [finite(end, "an end of a range") for end in ends]
    if not 1 <= len(ends) <= 3 or not all(isinstance(number, int) for number in numbers):
        raise CommandError("range takes one to three whole numbers")
    steps = range(*[int(number) for number in numbers])
    if len(steps) > MAX_ITEMS:
        raise CommandError(f"a range has {len(steps)} items (valid: at most {MAX_ITEMS})")
    return steps


PLAIN: Mapping[str, Callable[..., object]] = {
    "range": _range,
    "len": lambda items: len(_sequence(items)),
    "enumerate": lambda items: tuple(enumerate(_sequence(items))),
    "zip": lambda *items: tuple(zip(*(_sequence(item) for item in items), strict=False)),
    "min": lambda *values: min(_scalars(values)),
    "max": lambda *values: max(_scalars(values)),
    "sum": lambda *values: sum(_scalars(values)),
    "abs": lambda value: abs(finite(value, "what abs takes")),
    "round": lambda value: round(finite(value, "what round takes")),
    "int": lambda value: int(finite(value, "what int takes")),
}
