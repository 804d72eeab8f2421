"""Episodes, demonstrations and queries: what a robot records and asks (paper, section III-A).

Every value is checked when it is constructed. Positions are in meters in the world frame; quaternions are xyzw.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from app.pipeline.order.order import Order
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array, settle
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.names import checked_instruction
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, Pose
from roboprompt_client.types.trajectory import Trajectory

MIN_FREQUENCY_HZ, MAX_FREQUENCY_HZ = 0.01, 100_000.0  # slower than any recorder, and faster
CONTROL_FREQUENCY_HZ = 20.0  # of RLBench's demonstrations


@dataclass(frozen=True, eq=False)
class Episode:
    """A recorded trajectory with the instruction it carries out and the cameras' view of its first frame.

    Attributes:
        control_frequency_hz: as measured, where the trajectory has timestamps.
    """

    instruction: str
    trajectory: Trajectory
    frames: tuple[RgbdFrame, ...] = ()
    control_frequency_hz: float = CONTROL_FREQUENCY_HZ
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        settle(self, instruction=checked_instruction("instruction", self.instruction))
        if not MIN_FREQUENCY_HZ <= self.control_frequency_hz <= MAX_FREQUENCY_HZ:
            valid = f"a number in {MIN_FREQUENCY_HZ:g}..{MAX_FREQUENCY_HZ:g}"
            raise InvalidInputError("control_frequency_hz", f"is {self.control_frequency_hz:g}", valid)
        times_s = self.trajectory.timestamps_s
        if times_s is not None and len(times_s) > 1:
            measured_hz = round((len(times_s) - 1) / float(times_s[-1] - times_s[0]), 3)
            settle(self, control_frequency_hz=float(np.clip(measured_hz, MIN_FREQUENCY_HZ, MAX_FREQUENCY_HZ)))

    @property
    def times_s(self) -> Array:
        """(T,) of the frames, by the trajectory's clock if it has one, else from 0."""
        given_s = self.trajectory.timestamps_s
        return frame_times_s(self.trajectory, self.control_frequency_hz) if given_s is None else given_s


@dataclass(frozen=True, eq=False)
class Query:
    """What is to be done in an observed scene.

    Attributes:
        instruction: objects by their names, in the form of a taught instruction where there is one.
        start: where the end effector is before the first action, where that is known.
    """

    instruction: str
    objects: tuple[ObjectPose, ...]
    start: EndEffectorAction | None = field(default=None, kw_only=True)

    @cached_property
    def order(self) -> Order:
        """The instruction as a value."""
        return Order(self.instruction, tuple(pose.name for pose in self.objects))

    @cached_property
    def ordered_objects(self) -> tuple[ObjectPose, ...]:
        """The objects that the instruction mentions in its order, then the others as they come."""
        return in_order(self.objects, self.order)

    def object(self, name: str) -> ObjectPose:
        """The pose of the object of that name, which must exist."""
        return next(pose for pose in self.objects if pose.name == name)


@dataclass(frozen=True, eq=False)
class Demonstration(Query):
    """An episode as a prompt uses it: the objects' poses at its first frame and the actions at its keyframes."""

    actions: tuple[EndEffectorAction, ...]
    id: str = ""

    def only(self, names: Collection[str]) -> "Demonstration":
        """The demonstration with only those of its objects that have these names."""
        if all(pose.name in names for pose in self.objects):
            return self
        return replace(self, objects=tuple(pose for pose in self.objects if pose.name in names))


def start_at(hand: Pose | None) -> EndEffectorAction | None:
    """Return where the end effector is before the first action, as `Query.start` has it; None where it is not known."""
    return None if hand is None else EndEffectorAction(np.array(hand.position_m), np.array(hand.quaternion_xyzw), True)


def in_order(objects: Sequence[ObjectPose], order: Order) -> tuple[ObjectPose, ...]:
    """The objects that an order mentions, in its order, then the others as they come."""
    place = {name: k for k, name in enumerate(order.objects)}
    return tuple(sorted(objects, key=lambda pose: place.get(pose.name, len(place))))


def rotation_of(pose: ObjectPose) -> Array:
    """(4,) the rotation of an observed object that demonstrations have with one; raises InvalidInputError without."""
    if pose.quaternion_xyzw is None:
        field, message = f"objects[{pose.name}].quaternion_xyzw", "is missing, but every demonstration has it"
        raise InvalidInputError(field, message, "a unit quaternion, order x y z w")
    return pose.quaternion_xyzw


def frame_times_s(trajectory: Trajectory, control_frequency_hz: float = CONTROL_FREQUENCY_HZ) -> Array:
    """(T,) times of the frames in seconds, 0 at the first."""
    if trajectory.timestamps_s is not None:
        return trajectory.timestamps_s - float(trajectory.timestamps_s[0])
    times_s: Array = np.arange(len(trajectory)) / control_frequency_hz
    return times_s
