"""A plan before it moves anything: how far each pose is, whether the arm gets there, and what is in its way."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from roboprompt_client.arms.driver import Calibration
from roboprompt_client.arms.geometry import Geometry, Nearest
from roboprompt_client.errors import MotionError
from roboprompt_client.motion.guard import enters
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

COLUMNS = ("action", "position, m", "from base", "gripper", "reach", "nearest joint limit", "in the way")


@dataclass(frozen=True)
class Previewed:
    """One action of a plan.

    Attributes:
        from_base_m: of its position.
        reachable: None where too little is known of the arm.
        problem: why the straight way to it cannot be gone; empty if it can, or if that is not known.
        nearest: at its pose; None where the joints are not known.
        touches: boxes that the hand touches on the straight way to it.
    """

    action: EndEffectorAction
    from_base_m: float
    reachable: bool | None
    problem: str
    nearest: Nearest | None
    touches: tuple[Box, ...]

    @property
    def warning(self) -> str:
        """What a person must know before it moves; empty: nothing."""
        boxes = [f"the way touches the box {_box(box)}" for box in self.touches]
        return "; ".join([*([self.problem] if self.problem else []), *boxes])

    def cells(self, number: int) -> tuple[str, ...]:
        """A row of `COLUMNS`."""
        reach = {True: "yes", False: "NO", None: "not known"}[self.reachable]
        nearest = "not known" if self.nearest is None else f"joint {self.nearest.joint}, {self.nearest.margin_deg:.0f}°"
        return (
            str(number),
            " ".join(f"{value:.3f}" for value in self.action.position_m),
            f"{self.from_base_m:.3f} m",
            "open" if self.action.gripper_open else "closed",
            reach,
            nearest,
            ", ".join(map(_box, self.touches)) or "no known box",
        )


def preview_plan(
    actions: Iterable[EndEffectorAction],
    calibration: Calibration,
    limits: MotionLimits,
    *,
    geometry: Geometry | None = None,
    reach_m: float | None = None,
    joints_rad: Array | None = None,
    start_m: Sequence[float] | None = None,
) -> tuple[Previewed, ...]:
    """Each action in turn, reached straight from the one before.

    Args:
        calibration: where the arm's base stands.
        limits: the way is checked against their boxes to keep out of.
        geometry: of the arm's joints; None: not known.
        reach_m: how far from the base the hand gets, where the joints are not known; None: not known either.
        joints_rad: (J,) where the arm is; None: only the distance is compared with its reach.
        start_m: (3,) where the hand is, world frame; None: the way to the first action is not known.
    """
    previewed = []
    for action in actions:
        end_m: list[float] = action.position_m.tolist()
        away_m = float(np.linalg.norm(action.position_m - calibration.position_m))
        way = (end_m if start_m is None else start_m, end_m)
        touches = tuple(box for box in limits.keep_out if enters(*way, box, limits.hand_radius_m))
        start_m = end_m
        if geometry is None or joints_rad is None:
            reachable = None if reach_m is None else away_m <= reach_m
            beyond = "" if reachable is not False else f"the pose is out of reach: at most {reach_m:g} m"
            previewed.append(Previewed(action, away_m, reachable, beyond, None, touches))
            continue
        try:
            joints_rad = geometry.way(joints_rad, *calibration.to_base(action.position_m, action.quaternion_xyzw))
        except MotionError as error:  # the way to the next is looked at as if this one were left out
            previewed.append(Previewed(action, away_m, False, str(error), None, touches))
        else:
            nearest = geometry.nearest_limit(joints_rad)
            previewed.append(Previewed(action, away_m, True, "", nearest, touches))
    return tuple(previewed)


def _box(box: Box) -> str:
    low, high = (" ".join(f"{value:g}" for value in corner) for corner in box)
    return f"{low} to {high} m"
