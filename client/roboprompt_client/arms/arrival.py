"""What counts as arrived."""

from dataclasses import dataclass

from roboprompt_client.arms.driver import ArmState
from roboprompt_client.errors import MotionError
from roboprompt_client.trajectory import EndEffectorAction


@dataclass(frozen=True)
class Tolerance:
    """How near the end effector must come, and how long a motion may take."""

    position_m: float = 0.005
    rotation_deg: float = 2.0
    width_m: float = 0.004
    motion_s: float = 120.0

    def check_pose(self, state: ArmState, action: EndEffectorAction) -> None:
        """Raise MotionError if the end effector is not at the action's pose, both in one frame."""
        off_m, off_deg = state.distance_to(action.position_m, action.quaternion_xyzw)
        if not (off_m <= self.position_m and off_deg <= self.rotation_deg):
            raise MotionError(f"the motion ended {1000 * off_m:.1f} mm and {off_deg:.1f} degrees off its target")

    def check_gripper(self, width_m: float, open_width_m: float, *, is_open: bool) -> None:
        """Raise MotionError if fingers that measure `open_width_m` when open did not do as commanded."""
        if is_open and width_m < open_width_m - self.width_m:
            of_mm = f"{1000 * width_m:.1f} of {1000 * open_width_m:.1f} mm"
            raise MotionError(f"the gripper was to open, but measures {of_mm}")
        if not is_open and width_m > open_width_m - self.width_m:
            raise MotionError(f"the gripper was to close, but still measures {1000 * width_m:.1f} mm")


TOLERANCE = Tolerance()
