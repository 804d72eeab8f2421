"""Checks of what a program gives to a command."""

import math

from app.evaluation.baselines.voxposer.program.voxels import AXES, SIZE

MAX_CM = 1_000.0


class CommandError(Exception):
    """A command that cannot be carried out as it was called."""


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
        if not (isinstance(value, tuple | list) and len(value) == 4):
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
