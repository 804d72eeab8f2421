"""What an arm's interface must offer, in meters, radians and x y z w in its base frame; and where its base stands."""

import math
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array, finite_array, settle, unit_quaternions
from roboprompt_client.types.poses import Pose

CALIBRATION_JSON = '{"base_to_world": {"position": [x, y, z], "quaternion_xyzw": [x, y, z, w]}}, meters'
STEERED_S = 0.15  # that a velocity holds: what commands the arm may hang, or be cut off


@dataclass(frozen=True, eq=False)
class ArmState:
    """An arm at one moment.

    Attributes:
        position_m, quaternion_xyzw: (3,), (4,) end effector in the arm's base frame.
        joint_positions_rad: (J,), or None where the arm does not say.
        joint_velocities_rad_s: (J,), or None.
        gripper_width_m: measured between the fingers; None without fingers that are measured.
        gripper_open: where there is no width: what was commanded last; None without a gripper.
        wrench_n_nm: (6,) force and torque that act on the hand from outside, along the frame's axes; None.
    """

    position_m: Array
    quaternion_xyzw: Array
    joint_positions_rad: Array | None = None
    joint_velocities_rad_s: Array | None = None
    gripper_width_m: float | None = None
    gripper_open: bool | None = None
    wrench_n_nm: Array | None = None

    @property
    def force_n(self) -> float:
        """How strong the force on the hand is; 0 where the arm does not say."""
        return 0.0 if self.wrench_n_nm is None else float(np.linalg.norm(self.wrench_n_nm[:3]))

    def distance_to(self, position_m: Array, quaternion_xyzw: Array) -> tuple[float, float]:
        """How far the end effector is from a pose (3,), (4,) in the same frame: meters and degrees."""
        turn_rad = rotations.angle_between_rad(self.quaternion_xyzw, quaternion_xyzw)
        return float(np.linalg.norm(self.position_m - position_m)), math.degrees(turn_rad)

    def pose(self) -> Pose:
        """Of the end effector; raises InvalidInputError where it is not finite."""
        if not np.isfinite(self.position_m).all():
            raise InvalidInputError("end_effector", f"is {self.position_m.tolist()}", "finite numbers")
        return Pose(tuple(self.position_m.tolist()), tuple(self.quaternion_xyzw.tolist()))

    def matrix(self) -> Array:
        """(4, 4), the end effector's pose."""
        return pose_matrix(self.position_m, self.quaternion_xyzw)

    def moved(self, velocity_m_s: Array, turning_rad_s: Array, for_s: float) -> tuple[Array, Array]:
        """The end effector's pose (3,), (4,) after it has moved with velocities (3,), (3,) of the same frame."""
        turn = rotations.from_rotation_vector(for_s * turning_rad_s)
        return self.position_m + for_s * velocity_m_s, rotations.product(turn, self.quaternion_xyzw)


@dataclass(frozen=True, eq=False)
class Calibration:
    """The arm's base in the world frame: position (3,) m and rotation (4,) xyzw; by default the base is the world."""

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
        """The base is the world's origin."""
        return cls(np.zeros(3), rotations.IDENTITY)

    @classmethod
    def from_json(cls, document: object) -> "Calibration":
        """One of a JSON document; raises InvalidInputError if it is none."""
        pose = document.get("base_to_world") if isinstance(document, Mapping) else None
        if not isinstance(pose, Mapping) or not {"position", "quaternion_xyzw"} <= set(pose):
            raise InvalidInputError("base_to_world", f"is {pose!r:.80}", CALIBRATION_JSON)
        return cls(pose["position"], pose["quaternion_xyzw"])

    def to_world(self, position_m: Array, quaternion_xyzw: Array) -> tuple[Array, Array]:
        """A pose in the base frame, in the world frame."""
        turned = rotations.product(self.quaternion_xyzw, quaternion_xyzw)
        return self.position_m + rotations.rotated(self.quaternion_xyzw, position_m), rotations.canonical(turned)

    def state_to_world(self, state: ArmState) -> ArmState:
        """An arm's state in the base frame, in the world frame."""
        position_m, quaternion = self.to_world(state.position_m, state.quaternion_xyzw)
        wrench = state.wrench_n_nm
        if wrench is not None:
            wrench = np.concatenate([rotations.rotated(self.quaternion_xyzw, part) for part in np.split(wrench, 2)])
        return replace(state, position_m=position_m, quaternion_xyzw=quaternion, wrench_n_nm=wrench)

    def to_base(self, position_m: Array, quaternion_xyzw: Array) -> tuple[Array, Array]:
        """A pose in the world frame, in the base frame."""
        back = rotations.inverse(self.quaternion_xyzw)
        turned = rotations.product(back, quaternion_xyzw)
        return rotations.rotated(back, position_m - self.position_m), rotations.canonical(turned)


class Driver(Protocol):
    """A maker's interface. Only `halt` and `state` are called from another thread than the others.

    Every method raises MotionError if the arm does not answer, refuses, or does not do as commanded.

    Attributes:
        name: for people.
        proven: on what it has been seen to work; empty: on nothing but its interface's documentation.
    """

    name: str
    proven: str

    def state(self) -> ArmState:
        """The arm as it is now."""
        ...

    def check(self, position_m: Array, quaternion_xyzw: Array) -> None:
        """Raise MotionError if the pose, or the way to it, is out of reach or beyond a joint's limit; nothing moves."""
        ...

    def start(self, position_m: Array, quaternion_xyzw: Array) -> None:
        """Begin to move the end effector to the pose in a straight line, and return."""
        ...

    def finished(self) -> bool:
        """Whether the motion has ended at its target; waits for it up to some 50 ms."""
        ...

    def set_gripper(self, *, is_open: bool) -> None:
        """Open or close the gripper, and return when it has done so; nothing without a gripper."""
        ...

    def halt(self) -> None:
        """Stop whatever moves, at once; safe at any time and from any thread."""
        ...

    def recover(self) -> None:
        """Acknowledge an error that keeps the arm from moving: a person asked for it."""
        ...

    def close(self) -> None:
        """Leave the arm."""
        ...


@runtime_checkable
class Guidable(Protocol):
    """A driver that lets a person move its arm by hand."""

    def guided(self) -> AbstractContextManager[None]:
        """While it lasts the arm carries its own weight and yields to the hand; afterwards it holds still."""
        ...


@runtime_checkable
class Steerable(Protocol):
    """A driver whose arm follows velocities that are said again and again."""

    def steer(self, velocity_m_s: Array, turning_rad_s: Array) -> None:
        """Move the hand with a velocity (3,) and a turning (3,) along and about the base's axes, and return.

        It comes to rest by itself after `STEERED_S`, unless a further call takes this one's place; zeros: at once.
        """
        ...


def require_reach(position_m: Array, reach_m: float) -> None:
    """Raise MotionError for a position (3,) that is further than that from the base."""
    if (away_m := float(np.linalg.norm(position_m))) > reach_m:
        raise MotionError(f"the pose is out of reach: {away_m:.3f} m from the base, at most {reach_m:g} m")


def pose_matrix(position_m: Array, quaternion_xyzw: Array) -> Array:
    """(4, 4) of a position (3,) and a rotation (4,)."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotations.to_matrix(quaternion_xyzw)
    matrix[:3, 3] = position_m
    return matrix


def straight_way(
    here: ArmState, position_m: Array, quaternion_xyzw: Array, step_m: float, step_rad: float
) -> Iterator[tuple[Array, Array]]:
    """The poses on the way to one (3,), (4,) in the same frame, each at most a step from the one before."""
    way_m = position_m - here.position_m
    turn = rotations.to_rotation_vector(rotations.product(quaternion_xyzw, rotations.inverse(here.quaternion_xyzw)))
    steps = math.ceil(max(float(np.linalg.norm(way_m)) / step_m, float(np.linalg.norm(turn)) / step_rad, 1.0))
    for part in np.arange(1, steps + 1) / steps:
        yield here.moved(way_m, turn, part)
