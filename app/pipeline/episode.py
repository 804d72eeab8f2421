"""What a robot records and what the method makes of it (paper, section III-A).

Every value is checked when it is constructed. Positions are in metres in the world frame; quaternions are xyzw.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from roboprompt_client.arrays import settle
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose, Trajectory
from roboprompt_client.wording import checked_instruction

MIN_FREQUENCY_HZ, MAX_FREQUENCY_HZ = 0.01, 100_000.0  # slower than any recorder, and faster


@dataclass(frozen=True, eq=False)
class Episode:
    """A recorded trajectory with the instruction it carries out and the cameras' view of its first frame."""

    instruction: str
    trajectory: Trajectory
    frames: tuple[RgbdFrame, ...] = ()
    control_frequency_hz: float = 20.0
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        settle(self, instruction=checked_instruction("instruction", self.instruction))
        if not MIN_FREQUENCY_HZ <= self.control_frequency_hz <= MAX_FREQUENCY_HZ:
            valid = f"a number in {MIN_FREQUENCY_HZ:g}..{MAX_FREQUENCY_HZ:g}"
            raise InvalidInputError("control_frequency_hz", f"is {self.control_frequency_hz:g}", valid)


@dataclass(frozen=True, eq=False)
class Demonstration:
    """An episode as a prompt uses it: the objects' poses at its first frame and the actions at its keyframes.

    Attributes:
        later_objects: the objects' poses after each action, where the episode tracked them; otherwise empty.
        start: where the end effector was at first, where that is known.
        plan: demonstrations of equal plans and like instructions have the same rows, see
            `app.pipeline.plans`; None: the keyframes are as they were found.
    """

    instruction: str
    objects: tuple[ObjectPose, ...]
    actions: tuple[EndEffectorAction, ...]
    id: str = ""
    later_objects: tuple[tuple[ObjectPose, ...], ...] = ()
    start: EndEffectorAction | None = None
    plan: int | None = None

    def object(self, name: str) -> ObjectPose:
        """The pose of the object of that name, which there is."""
        return next(pose for pose in self.objects if pose.name == name)
