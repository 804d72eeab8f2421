"""A camera in the hand sees the scene from several sides: the hand goes to viewpoints, and takes a picture at each."""

import time
from collections.abc import Callable
from typing import Protocol

from roboprompt_client.arrays import Array
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.cameras.rig import Rig
from roboprompt_client.errors import NotConfirmedError
from roboprompt_client.motion_limits import Pose

SETTLE_S = 0.3  # after a motion: arms swing a little
ConfirmViewpoint = Callable[[int, Pose], bool]


class Carrier(Protocol):
    """An arm whose hand carries cameras."""

    viewpoints: tuple[Pose, ...]
    confirm_viewpoint: ConfirmViewpoint | None

    def hand_to_world(self) -> Array:
        """The hand's pose (4, 4) now."""
        ...

    def go_to(self, pose: Pose) -> None:
        """Move within the cell's limits, or raise; the gripper stays as it is."""
        ...


def look_around(arm: Carrier, rig: Rig) -> tuple[RgbdFrame, ...]:
    """The frames of all cameras: of one in the hand one at each viewpoint, as NAME.1, NAME.2 ...

    Cameras that stand still take theirs before the hand moves, and where there are no viewpoints, all take one.

    Raises:
        CameraError: naming the camera whose picture cannot be used.
        NotConfirmedError: if a person did not let the hand go to a viewpoint.
        MotionError, UnsafeActionError: as `Arm.execute`.
    """
    carried = [camera for camera in rig.cameras if camera.in_hand]
    if not arm.viewpoints or not carried:
        return rig.frames(arm.hand_to_world)
    frames = list(rig.frames(only=[camera.name for camera in rig.cameras if not camera.in_hand]))
    for number, pose in enumerate(arm.viewpoints, 1):
        if arm.confirm_viewpoint is not None and not arm.confirm_viewpoint(number, pose):
            raise NotConfirmedError(f"viewpoint {number} was not allowed: there is no picture from it")
        arm.go_to(pose)
        time.sleep(SETTLE_S)
        for camera in carried:
            picture = rig.picture(camera, arm.hand_to_world)
            frames.append(camera.calibrated(*picture, name=f"{camera.name}.{number}"))
    return tuple(frames)
