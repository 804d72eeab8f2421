"""An arm's driver to start from: `roboprompt_client.arms.driver.Driver` says what each method promises.

This arm is imaginary: it is where it was sent. Put your maker's calls where the comments are.
"""

import numpy as np

from roboprompt_client.arms.driver import ArmState


class MyArm:
    """Meters, radians, quaternions x y z w, all in the arm's base frame."""

    name = "my arm"
    proven = "nothing: it is imaginary"

    def __init__(self, address: str) -> None:
        self._position_m, self._quaternion_xyzw = np.array([0.30, 0.0, 0.50]), np.array([1.0, 0.0, 0.0, 0.0])
        self._gripper_open = False
        # connect to `address`

    def state(self) -> ArmState:
        """Ask the arm where it is."""
        return ArmState(self._position_m, self._quaternion_xyzw, gripper_open=self._gripper_open)

    def check(self, position_m: np.ndarray, quaternion_xyzw: np.ndarray) -> None:
        """Raise roboprompt_client.errors.MotionError if the pose is out of reach; nothing moves."""

    def start(self, position_m: np.ndarray, quaternion_xyzw: np.ndarray) -> None:
        """Begin a straight motion of the hand, and return."""
        self._position_m, self._quaternion_xyzw = np.array(position_m), np.array(quaternion_xyzw)

    def finished(self) -> bool:
        """Whether the motion has ended; MotionError if it ended elsewhere than at its target."""
        return True

    def set_gripper(self, *, is_open: bool) -> None:
        """Open or close the gripper, and wait until it has done so."""
        self._gripper_open = is_open

    def halt(self) -> None:
        """Stop at once, from any thread."""

    def recover(self) -> None:
        """Acknowledge an error, because a person asked for it."""

    def close(self) -> None:
        """Leave the arm."""
