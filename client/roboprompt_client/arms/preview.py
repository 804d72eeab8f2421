"""The preview of a plan before anything moves: whether the arm reaches each pose, and which boxes it touches."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from roboprompt_client.arms.driver import Calibration
from roboprompt_client.arms.geometry import Chain, Nearest
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
        from_base_m: distance of its position from the arm's base.
        reachable: None if the arm's reach is not known.
        problem: why the arm cannot follow the straight way to it; empty if it can, or if that is not known.
        nearest: the joint nearest to its limit at the pose; None if the joints are not known.
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
        """What is wrong with the action; empty if nothing is."""
        boxes = [f"the way touches the box {_box(box)}" for box in self.touches]
        return "; ".join([*([self.problem] if self.problem else []), *boxes])

    def cells(self, number: int) -> tuple[str, ...]:
        """Return a row of `COLUMNS`."""
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
    geometry: Chain | None = None,
    joints_rad: Array | None = None,
    start_m: Sequence[float] | None = None,
) -> tuple[Previewed, ...]:
    """Return the preview of each action, reached in a straight line from the one before.

    Args:
        calibration: the pose of the arm's base.
        limits: the way is checked against their `keep_out` boxes.
        geometry, joints_rad: the arm's joints and where they are now, (J,); None: reach is not known.
        start_m: (3,) the hand's present position in the world frame; None: the first way is not checked.
    """
    previewed = []
    for action in actions:
        end_m: list[float] = action.position_m.tolist()
        way = (end_m if start_m is None else start_m, end_m)
        touches = tuple(box for box in limits.keep_out if enters(*way, box, limits.hand_radius_m))
        start_m, reachable, nearest, problem = end_m, None, None, ""
        if geometry is not None and joints_rad is not None:
            try:
                joints_rad = geometry.way(joints_rad, *calibration.to_base(action.position_m, action.quaternion_xyzw))
                reachable, nearest = True, geometry.nearest_limit(joints_rad)
            except MotionError as error:  # the next way is checked as if this action were left out
                reachable, problem = False, str(error)
        away_m = float(np.linalg.norm(action.position_m - calibration.position_m))
        previewed.append(Previewed(action, away_m, reachable, problem, nearest, touches))
    return tuple(previewed)


def _box(box: Box) -> str:
    low, high = (" ".join(f"{value:g}" for value in corner) for corner in box)
    return f"{low} to {high} m"
