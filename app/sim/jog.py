"""The simulated arm moved by a person at the keyboard: the hand moves while a key is held."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim import panda
from app.sim.moves import ToolPose
from app.sim.robot import VELOCITY_LEAD_S, SimulatedPanda
from app.sim.tasks.base import SimTask
from app.sim.world import TIMESTEP_S
from roboprompt_client.arrays import Array
from roboprompt_client.recording.teleop import DIRECTIONS, HeldKeys

TICK_S = 0.02
SPEED_M_S, TURN_RAD_S = 0.10, 0.7
RAMP_S = 0.06  # the speed comes and goes by 1/e in this time
ITERATIONS = 10
MAX_STEP_RAD = 0.1  # a joint that would have to go further in a tick has met the end of the arm's reach
MAX_LEAD_M = 0.02  # a hand that is further behind has met something

GRIPPER, DONE, GIVE_UP = " ", "\n", "x"
SCALE = np.repeat([SPEED_M_S, TURN_RAD_S], 3)


class JoggedPanda(SimulatedPanda):
    """The arm of a task's scene under a person's keys; simulated time passes by ticks of 20 ms."""

    def __init__(self, task: SimTask) -> None:
        super().__init__(task, cameras=())
        self._wanted = self.hand
        self._velocity: Array = np.zeros(6)

    def switch_gripper(self) -> None:
        """Close the fingers, or open them; they take a while."""
        opens = not self.gripper_commanded_open
        self.task.data.ctrl[panda.GRIPPER_CTRL] = panda.FINGER_TRAVEL_M if opens else 0.0

    def tick(self, direction: Array) -> None:
        """Let 20 ms pass, the hand going in a direction as of `roboprompt_client.recording.teleop`.

        At the end of the arm's reach, and against something firm, it stays where it is.
        """
        self._velocity = self._velocity + (SCALE * direction - self._velocity) * (1 - np.exp(-TICK_S / RAMP_S))
        moved = self._moved()
        joints = self._kinematics.solve(moved, self._target_rad, ITERATIONS, self._target_rad)
        if joints is None or np.abs(joints - self._target_rad).max() > MAX_STEP_RAD or self._blocked(moved):
            self._velocity, joints = np.zeros(6), self._target_rad
        else:
            self._wanted = moved
        parts = np.arange(1, round(TICK_S / TIMESTEP_S) + 1)[:, None] * TIMESTEP_S / TICK_S
        ahead = VELOCITY_LEAD_S * (joints - self._target_rad) / TICK_S
        self._run(self._target_rad + parts * (joints - self._target_rad) + ahead)
        self._target_rad = joints

    def _moved(self) -> ToolPose:
        turn = Rotation.from_rotvec(self._velocity[3:] * TICK_S)
        return ToolPose(self._wanted.position_m + self._velocity[:3] * TICK_S, turn * self._wanted.rotation)

    def _blocked(self, moved: ToolPose) -> bool:
        behind_m, before_m = (self.hand.apart(pose)[0] for pose in (moved, self._wanted))
        return behind_m > MAX_LEAD_M and behind_m > before_m


def drive(
    arm: JoggedPanda, pressed: Callable[[], str], on_first: Callable[[], None], on_tick: Callable[[], None]
) -> bool:
    """Let a person move the arm until they are done; whether what they did is to be kept.

    Args:
        pressed: the keys pressed since it was called last.
        on_first: called before the first key that does something.
        on_tick: called after each tick.
    """
    keys = HeldKeys()
    begun = False
    while True:
        for key in pressed():
            if key in (DONE, GIVE_UP):
                return key == DONE
            if not begun and (key == GRIPPER or key in DIRECTIONS):
                begun = True
                on_first()
            if key == GRIPPER:
                arm.switch_gripper()
            elif key in DIRECTIONS:
                keys.press(key, arm.task.data.time)
        arm.tick(keys.direction(arm.task.data.time))
        on_tick()
