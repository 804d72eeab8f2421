"""Steer the hand with a LeRobot leader arm, such as an SO-101's: the hand repeats the motions of the leader's tip.

    # my_leader.py, for `roboprompt-robot record --teleop my_leader:make`
    def make():
        config = SO101LeaderConfig(port="/dev/ttyACM1", id="leader", use_degrees=True)
        return Leader(SO101Leader(config), "so101_new_calib.urdf")

Motions are relative: wherever the leader is when a recording begins, the hand starts from where it is.
"""

import time
from pathlib import Path
from typing import Any

import numpy as np

from roboprompt_client.arms.driver import STEERED_S, MakersObject
from roboprompt_client.arms.urdf import UrdfGeometry
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.recording.teleop import SPEED_M_S, TURN_RAD_S, PersonInput
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array

NAME = "leader arm"
JOINT, GRIPPER = ".pos", "gripper"
LAG_S = 0.2  # the hand is at full speed if it is so far behind; what the leader moves beyond that is lost
AT_REST_M, AT_REST_RAD = 0.002, 0.02  # encoders and people tremble: a hand at rest does not follow so little
ARRIVED = 0.25  # of it: a hand that follows comes so near
OPEN_ABOVE, CLOSED_BELOW = 60.0, 40.0  # of the leader's gripper, 0 closed to 100 open


class Leader:
    """What `record --teleop MODULE:FACTORY` opens for each recording.

    Args:
        teleoperator: with LeRobot's Teleoperator interface; its actions are joint angles `NAME.pos` in degrees, with
            the names of the URDF's joints, and `gripper.pos`.
        urdf: of the leader. Its base's axes count as the world's.
        frame: the URDF's link whose motions the hand repeats.

    Raises:
        InvalidInputError: if the teleoperator reports no degrees, or as `UrdfGeometry`.
    """

    def __init__(
        self,
        teleoperator: Any,  # noqa: ANN401
        urdf: Path | str,
        frame: str = "gripper_frame_link",
    ) -> None:
        if not getattr(getattr(teleoperator, "config", None), "use_degrees", True):
            raise InvalidInputError("--teleop", f"{NAME}: its joints are not in degrees", "use_degrees=True")
        self._made, self._calls = teleoperator, MakersObject(NAME, teleoperator)
        self._geometry = UrdfGeometry.read(Path(urdf), frame)
        self._behind: Array = np.zeros(6)  # meters, radians that the hand still has to make up for
        self._direction: Array = np.zeros(6)
        self._tip, self._read_s, self._is_open = np.eye(4), 0.0, True

    def __enter__(self) -> "Leader":
        """Connect; raises MotionError if that fails, or the leader is not calibrated."""
        if not self._made.is_connected:
            self._calls.connect(calibrate=False)
        if not self._made.is_calibrated:
            self._calls.disconnect()
            raise MotionError(f"{NAME}: not calibrated: run lerobot-calibrate first")
        self._behind, self._direction = np.zeros(6), np.zeros(6)
        self._tip, opened = self._observed()
        self._read_s, self._is_open = time.monotonic(), opened > (OPEN_ABOVE + CLOSED_BELOW) / 2
        return self

    def __exit__(self, *_: object) -> None:
        self._calls.disconnect()

    def read(self, keys: str) -> PersonInput:
        """Return the direction in which the hand follows, and the keys, with one where the leader's gripper switched.

        Raises:
            MotionError: if the leader does not answer.
        """
        (tip, opened), before, before_s = self._observed(), self._tip, self._read_s
        self._tip, self._read_s = tip, time.monotonic()
        turn = rotations.to_rotation_vector(rotations.from_matrix(tip[:3, :3] @ before[:3, :3].T))
        moved, made_s = np.concatenate([tip[:3, 3] - before[:3, 3], turn]), min(self._read_s - before_s, STEERED_S)
        for part, speed, at_rest in ((slice(3), SPEED_M_S, AT_REST_M), (slice(3, 6), TURN_RAD_S, AT_REST_RAD)):
            was = self._direction[part]
            behind = _at_most(self._behind[part] - made_s * speed * was + moved[part], LAG_S * speed)
            still = np.linalg.norm(behind) < (ARRIVED * at_rest if was.any() else at_rest)
            self._behind[part], self._direction[part] = behind, 0.0 if still else behind / (LAG_S * speed)
        return PersonInput(self._direction.copy(), keys + self._switch(opened))

    def _switch(self, opened: float) -> str:
        if (opened < CLOSED_BELOW) if self._is_open else (opened > OPEN_ABOVE):
            self._is_open = not self._is_open
            return "o" if self._is_open else "c"
        return ""

    def _observed(self) -> tuple[Array, float]:
        """Return the tip's pose (4, 4) in the leader's base frame, and how far its gripper is open, 0 to 100."""
        action = {name.removesuffix(JOINT): float(value) for name, value in self._calls.get_action().items()}
        if GRIPPER not in action:
            raise MotionError(f"{NAME}: its action has no {GRIPPER}{JOINT}, but {', '.join(action)}")
        opened = action[GRIPPER]
        return self._geometry.frame({name: np.radians(angle) for name, angle in action.items()}), opened


def _at_most(vector: Array, length: float) -> Array:
    return vector * min(1.0, length / max(float(np.linalg.norm(vector)), 1e-12))
