"""The bounds that an action must keep before a robot carries it out; one beyond them is an error, never clipped."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, NamedTuple

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import Pose

HAND_RADIUS_M = 0.05
USUAL_ACTIONS = 25  # of one prediction (RoboPrompt, section IV-B: the steps of an episode)
MAX_ACTIONS = 100  # of one prediction, whatever a request asks for
STEP_BOUNDS = ("max_step_m", "max_step_rotation_deg")
BOUNDS = ("keep_out", *STEP_BOUNDS, "hand_radius_m")


class Box(NamedTuple):
    """An axis-aligned box in the world frame: corners (3,) of the smallest and the largest coordinates, meters."""

    min_m: tuple[float, ...]
    max_m: tuple[float, ...]


@dataclass(frozen=True)
class MotionLimits:
    """The bounds of a robot's motion.

    Attributes:
        workspace: the box in which every target must lie; None: unbounded.
        keep_out: boxes that a sphere around the end effector must not enter, neither at a target nor on the straight
            way between targets.
        max_step_m, max_step_rotation_deg: the largest step between consecutive targets; None: unbounded.
        hand_radius_m: the radius of that sphere; 0: only the end effector's own position must keep out.

    Raises:
        InvalidInputError: if a bound is not a finite number, or a box is empty.
    """

    workspace: Box | None = None
    keep_out: tuple[Box, ...] = ()
    max_step_m: float | None = None
    max_step_rotation_deg: float | None = None
    hand_radius_m: float = HAND_RADIUS_M

    def __post_init__(self) -> None:
        if self.workspace is not None:
            _checked_box("workspace", *self.workspace)
        for k, box in enumerate(self.keep_out):
            _checked_box(f"motion_limits.keep_out[{k}]", *box)
        if self.max_step_m is not None:
            checked_bound("motion_limits.max_step_m", self.max_step_m)
        if self.max_step_rotation_deg is not None:
            checked_bound("motion_limits.max_step_rotation_deg", self.max_step_rotation_deg, 180)
        checked_bound("motion_limits.hand_radius_m", self.hand_radius_m, zero=True)

    @classmethod
    def from_task(cls, document: object) -> "MotionLimits":
        """Return the limits of a task's document (`GET /tasks/{name}`), which must have all of them.

        Raises:
            InvalidInputError: naming a bound that is missing or cannot hold, such as NaN.
        """
        bounds = _member(document, "", "motion_limits")
        for name in ("keep_out", *STEP_BOUNDS):
            _member(bounds, "motion_limits", name)
        known = {name: bounds[name] for name in BOUNDS if name in bounds}
        return cls(_box("workspace", _member(document, "", "workspace")), **{**known, "keep_out": _boxes(bounds)})

    @classmethod
    def from_file(cls, document: object) -> "MotionLimits":
        """Return limits written like a task's document, in which any bound may be left out.

        Raises:
            InvalidInputError: as `from_task`; also for an unknown bound, or if there is none.
        """
        if not isinstance(document, Mapping) or not {"workspace", "motion_limits"} & set(document):
            valid = "an object with workspace, motion_limits or both"
            raise InvalidInputError("limits", f"are {document!r:.80}", valid)
        bounds = document.get("motion_limits", {})
        if not isinstance(bounds, Mapping) or not set(bounds) <= set(BOUNDS):
            raise InvalidInputError("motion_limits", f"is {bounds!r:.80}", f"an object with {', '.join(BOUNDS)}")
        workspace = _box("workspace", document["workspace"]) if "workspace" in document else None
        return cls(workspace, **{**bounds, "keep_out": _boxes(bounds)})

    @property
    def bounds_steps(self) -> bool:
        """Whether steps are bounded, so that the pose before the first action must be known."""
        return self.max_step_m is not None or self.max_step_rotation_deg is not None

    def require_start(self, end_effector: Pose | None) -> None:
        """Raise InvalidInputError if steps are bounded and the end effector's pose is not known."""
        if end_effector is None and self.bounds_steps:
            bounds = " and ".join(name for name in STEP_BOUNDS if getattr(self, name) is not None)
            message = f"is left out, but {bounds} must hold for the step to the first target, too"
            raise InvalidInputError("end_effector", message, "where the end effector is: position and quaternion_xyzw")

    def intersection(self, other: "MotionLimits") -> "MotionLimits":
        """Return limits that keep both: the common workspace, all boxes, the shorter steps, the larger hand radius.

        Raises:
            InvalidInputError: if the workspaces do not overlap.
        """
        return MotionLimits(
            _common(self.workspace, other.workspace),
            (*self.keep_out, *other.keep_out),
            _smaller(self.max_step_m, other.max_step_m),
            _smaller(self.max_step_rotation_deg, other.max_step_rotation_deg),
            max(self.hand_radius_m, other.hand_radius_m),
        )


def _member(document: object, field: str, name: str) -> Any:  # noqa: ANN401
    """Return the member `name` of the JSON object at the path `field` ("" for the whole document)."""
    if not isinstance(document, Mapping):
        raise InvalidInputError(field or "limits", f"is {document!r:.80}", "a JSON object")
    if name not in document:
        valid = "the bounds of motion in full, as GET /tasks/{name} has them"
        raise InvalidInputError(f"{field}.{name}".lstrip("."), "is missing", valid)
    return document[name]


def _checked_box(field: str, low: object, high: object) -> Box:
    """Return the box between two corners (3,); raise InvalidInputError unless the first is below the second."""
    box = Box(_point(f"{field}.min", low), _point(f"{field}.max", high))
    if not all(a < b for a, b in zip(*box, strict=True)):
        raise InvalidInputError(field, f"has min {list(box.min_m)} and max {list(box.max_m)}", "min below max")
    return box


def checked_bound(field: str, value: object, most: float = math.inf, *, zero: bool = False) -> float:
    """Return a finite number above 0 (with `zero`: or 0) and at most `most`, else raise InvalidInputError."""
    number = _number(value)
    if number is None or not (number >= 0 if zero else number > 0) or number > most:
        upper = "" if math.isinf(most) else f" and at most {most:g}"
        raise InvalidInputError(
            field, f"is {value!r:.80}", f"a finite number {'at least' if zero else 'above'} 0{upper}"
        )
    return number


def _point(field: str, value: object) -> tuple[float, ...]:
    items = value if isinstance(value, Sequence) and not isinstance(value, str) else ()
    numbers = [number for item in items if (number := _number(item)) is not None]
    if len(numbers) != 3 or len(items) != 3:
        raise InvalidInputError(field, f"is {value!r:.80}", "3 finite numbers, in meters")
    return tuple(numbers)


def _number(value: object) -> float | None:
    """Return the value as a float, or None if it is not a finite number."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _box(field: str, value: object) -> Box:
    return _checked_box(field, _member(value, field, "min"), _member(value, field, "max"))


def _boxes(bounds: Mapping[str, Any]) -> tuple[Box, ...]:
    if not isinstance(boxes := bounds.get("keep_out", []), list):
        raise InvalidInputError("motion_limits.keep_out", f"is {boxes!r:.80}", "a list of boxes with min and max")
    return tuple(_box(f"motion_limits.keep_out[{k}]", box) for k, box in enumerate(boxes))


def _common(first: Box | None, second: Box | None) -> Box | None:
    if first is None or second is None:
        return first or second
    return Box(tuple(map(max, first.min_m, second.min_m)), tuple(map(min, first.max_m, second.max_m)))


def _smaller(first: float | None, second: float | None) -> float | None:
    return min((bound for bound in (first, second) if bound is not None), default=None)
