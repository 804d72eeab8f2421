"""What is known of an arm's joints: whether a straight way can be gone, and where they are at its end."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from roboprompt_client.arms.panda_kinematics import LIMITS_RAD, READY_RAD, check_way
from roboprompt_client.arrays import Array
from roboprompt_client.errors import InvalidInputError

HAND_YAW_RAD, HAND_M = -np.pi / 4, 0.1034  # the Franka Hand on its flange, down to between the fingertips


class Nearest(NamedTuple):
    """The joint that is nearest to a limit of its own, counted from 1, and how far it is from it; below 0: beyond."""

    joint: int
    margin_deg: float


class Geometry(Protocol):
    """An arm's joints, in its base frame."""

    def way(self, joints_rad: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        """The joints (J,) at the end of the straight way from joints (J,) to a pose.

        Raises:
            MotionError: if it is out of reach or beyond a joint's limit; says which.
        """
        ...

    def nearest_limit(self, joints_rad: Array) -> Nearest:
        """The joint that is nearest to its limit."""
        ...


@runtime_checkable
class KnowsItsJoints(Protocol):
    """A driver whose arm's geometry is known."""

    def geometry(self) -> Geometry:
        """With the tool that the arm has now.

        Raises:
            MotionError: if the arm does not answer.
        """
        ...


@dataclass(frozen=True, eq=False)
class PandaGeometry:
    """A Franka Panda's or Research 3's.

    Args:
        model: `panda` or `fr3`: whose joint limits hold.
        flange_to_tip: (4, 4) tip to flange; None: the Franka Hand's.

    Raises:
        InvalidInputError: for another model.
    """

    model: str = "fr3"
    flange_to_tip: Array | None = None

    def __post_init__(self) -> None:
        if self.model not in LIMITS_RAD:
            raise InvalidInputError("model", f"is {self.model!r:.40}", ", ".join(LIMITS_RAD))

    def way(self, joints_rad: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        tip = franka_hand() if self.flange_to_tip is None else self.flange_to_tip
        return check_way(joints_rad, tip, position_m, quaternion_xyzw, self.model)

    def nearest_limit(self, joints_rad: Array) -> Nearest:
        return nearest_limit(joints_rad, *(np.array(bound) for bound in LIMITS_RAD[self.model]))

    @property
    def ready_rad(self) -> Array:
        """(7,) the maker's ready pose, the hand pointing down."""
        return np.array(READY_RAD)


def nearest_limit(joints_rad: Array, low_rad: Array, high_rad: Array) -> Nearest:
    """Which of the joints (J,) is nearest to its bounds (J,)."""
    margins = np.minimum(joints_rad - low_rad, high_rad - joints_rad)
    index = int(margins.argmin())
    return Nearest(index + 1, float(np.degrees(margins[index])))


def franka_hand() -> Array:
    """(4, 4) the point between the fingertips to the flange."""
    cos, sin = np.cos(HAND_YAW_RAD), np.sin(HAND_YAW_RAD)
    return np.array([[cos, -sin, 0, 0], [sin, cos, 0, 0], [0, 0, 1, HAND_M], [0, 0, 0, 1]])
