"""What a maker's interface must offer (`Driver`), in meters, radians and quaternions xyzw in the arm's base frame."""

import math
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array, finite_array, settle, unit_quaternions
from roboprompt_client.types.poses import Pose

CALIBRATION_JSON = '{"base_to_world": {"position": [x, y, z], "quaternion_xyzw": [x, y, z, w]}}, meters'
LOOK_FIRST = "once a person has looked, call recover(), or type roboprompt-robot recover"


@dataclass(frozen=True, eq=False)
class ArmState:
    """An arm at one moment.

    Attributes:
        position_m, quaternion_xyzw: (3,), (4,) end effector in the arm's base frame.
        joint_positions_rad, joint_velocities_rad_s: (J,), or None where the arm does not report them.
        gripper_width_m: measured between the fingers, or None.
        gripper_open: where no width is measured: as the arm reports it, or the last command; None: not known.
        wrench_n_nm: (6,) external force and torque on the hand, along the frame's axes, or None.
        time_s: by the arm's own clock, or None.
    """

    position_m: Array
    quaternion_xyzw: Array
    joint_positions_rad: Array | None = None
    joint_velocities_rad_s: Array | None = None
    gripper_width_m: float | None = None
    gripper_open: bool | None = None
    wrench_n_nm: Array | None = None
    time_s: float | None = None

    def __post_init__(self) -> None:
        names = ("position_m", "quaternion_xyzw", "joint_positions_rad", "joint_velocities_rad_s", "wrench_n_nm")
        known = {name: value for name in names if (value := getattr(self, name)) is not None}
        settle(self, **{name: np.asarray(value, np.float64) for name, value in known.items()})

    @property
    def force_n(self) -> float:
        """The magnitude of the force on the hand; 0 where the arm does not report it."""
        return 0.0 if self.wrench_n_nm is None else float(np.linalg.norm(self.wrench_n_nm[:3]))

    def distance_to(self, position_m: Array, quaternion_xyzw: Array) -> tuple[float, float]:
        """Return the end effector's distance in meters and degrees from a pose (3,), (4,) in the same frame."""
        turn_rad = rotations.angle_between_rad(self.quaternion_xyzw, quaternion_xyzw)
        return float(np.linalg.norm(self.position_m - position_m)), math.degrees(turn_rad)

    def pose(self) -> Pose:
        """Return the end effector's pose; raises InvalidInputError if it is not finite."""
        if not np.isfinite(self.position_m).all():
            raise InvalidInputError("end_effector", f"is {self.position_m.tolist()}", "finite numbers")
        return Pose(self.position_m, self.quaternion_xyzw)

    def matrix(self) -> Array:
        """Return the end effector's pose as (4, 4)."""
        return pose_matrix(self.position_m, self.quaternion_xyzw)


@dataclass(frozen=True, eq=False)
class Calibration:
    """The arm's base in the world frame: position (3,) m and rotation (4,) xyzw."""

    position_m: Array
    quaternion_xyzw: Array

    def __post_init__(self) -> None:
        settle(
            self,
            position_m=finite_array("base_to_world.position", self.position_m, (3,)),
            quaternion_xyzw=unit_quaternions("base_to_world.quaternion_xyzw", self.quaternion_xyzw, (4,)),
        )

    @classmethod
    def none(cls) -> "Calibration":
        """Return the calibration of a base at the world's origin."""
        return cls(np.zeros(3), rotations.IDENTITY)

    @classmethod
    def from_json(cls, document: object) -> "Calibration":
        """Return the `base_to_world` of a JSON document; raises InvalidInputError if it is malformed."""
        pose = document.get("base_to_world") if isinstance(document, Mapping) else None
        if not isinstance(pose, Mapping) or not {"position", "quaternion_xyzw"} <= set(pose):
            raise InvalidInputError("base_to_world", f"is {pose!r:.80}", CALIBRATION_JSON)
        return cls(pose["position"], pose["quaternion_xyzw"])

    def to_world(self, position_m: Array, quaternion_xyzw: Array) -> tuple[Array, Array]:
        """Transform a pose (3,), (4,) from the base frame to the world frame."""
        turned = rotations.product(self.quaternion_xyzw, quaternion_xyzw)
        return self.position_m + rotations.rotated(self.quaternion_xyzw, position_m), rotations.canonical(turned)

    def state_to_world(self, state: ArmState) -> ArmState:
        """Transform an arm's state from the base frame to the world frame."""
        position_m, quaternion = self.to_world(state.position_m, state.quaternion_xyzw)
        wrench = state.wrench_n_nm
        if wrench is not None:
            wrench = np.concatenate([rotations.rotated(self.quaternion_xyzw, part) for part in np.split(wrench, 2)])
        return replace(state, position_m=position_m, quaternion_xyzw=quaternion, wrench_n_nm=wrench)

    def to_base(self, position_m: Array, quaternion_xyzw: Array) -> tuple[Array, Array]:
        """Transform a pose (3,), (4,) from the world frame to the base frame."""
        back = rotations.inverse(self.quaternion_xyzw)
        turned = rotations.product(back, quaternion_xyzw)
        return rotations.rotated(back, position_m - self.position_m), rotations.canonical(turned)


class Driver(Protocol):
    """A maker's interface. `halt` and `state` may be called from other threads, the other methods from one only.

    Every method raises MotionError if the arm does not answer, refuses, or does not do as commanded. A driver may also
    have the methods of `Guidable` and of `geometry.KnowsItsJoints`.

    Attributes:
        name: for people.
        proven: what it was tested with; empty: written from documentation only.
    """

    name: str
    proven: str

    def state(self) -> ArmState:
        """Return the arm's present state."""

    def check(self, position_m: Array, quaternion_xyzw: Array) -> None:
        """Raise MotionError if the pose is out of reach or beyond a joint's limit; nothing moves.

        Where the geometry is not known, each pose of a plan is asked about before the first motion.
        """

    def start(self, position_m: Array, quaternion_xyzw: Array) -> None:
        """Start to move the end effector to the pose in a straight line, and return at once."""

    def finished(self) -> bool:
        """Return whether the motion has ended; wait for its end for about 50 ms."""

    def set_gripper(self, *, is_open: bool) -> None:
        """Open or close the gripper, and return when that is done; do nothing without a gripper."""

    def halt(self) -> None:
        """Stop all motion at once, from any thread; no further step of a motion may be sent afterwards."""

    def recover(self) -> None:
        """Acknowledge an error that keeps the arm from moving; called only after a person asked for it."""

    def close(self) -> None:
        """Disconnect."""


@runtime_checkable
class Guidable(Protocol):
    """A driver whose arm a person can move by hand."""

    def guided(self) -> AbstractContextManager[None]:
        """Within the context the arm compensates its weight and yields to the hand; afterwards it holds still."""


def pose_matrix(position_m: Array, quaternion_xyzw: Array) -> Array:
    """Return (4, 4) of a position (3,) and a rotation (4,)."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotations.to_matrix(quaternion_xyzw)
    matrix[:3, 3] = position_m
    return matrix


def straight_way(
    here: ArmState, position_m: Array, quaternion_xyzw: Array, step_m: float, step_rad: float
) -> Iterator[tuple[Array, Array]]:
    """Yield poses on the straight way to a pose (3,), (4,) in the same frame, at most one step apart."""
    way_m = position_m - here.position_m
    turn = rotations.to_rotation_vector(rotations.product(quaternion_xyzw, rotations.inverse(here.quaternion_xyzw)))
    steps = math.ceil(max(float(np.linalg.norm(way_m)) / step_m, float(np.linalg.norm(turn)) / step_rad, 1.0))
    for part in np.arange(1, steps + 1) / steps:
        turned = rotations.product(rotations.from_rotation_vector(part * turn), here.quaternion_xyzw)
        yield here.position_m + part * way_m, turned
