"""The simulated arm moved by a person at the keyboard: the hand moves while a key is held."""

from collections.abc import Callable, Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim import panda
from app.sim.moves import ToolPose
from app.sim.robot import VELOCITY_LEAD_S, SimulatedPanda
from app.sim.tasks.base import SimTask
from app.sim.world import TIMESTEP_S
from roboprompt_client.arrays import Array

TICK_S = 0.02
SPEED_M_S, TURN_RAD_S = 0.10, 0.7
RAMP_S = 0.06  # the speed comes and goes by 1/e in this time
HELD_S = 0.15  # after its last press a key counts as held: terminals repeat it 20 to 30 times a second
# A key that is tapped moves the hand by 3 mm, one that is held has its full speed after a while.
TAPPED_SHARE, FULL_AFTER_S = 0.2, 1.0
ITERATIONS = 10
MAX_STEP_RAD = 0.1  # a joint that would have to go further in a tick has met the end of the arm's reach
MAX_LEAD_M = 0.02  # a hand that is further behind has met something

# Along x (away from the robot), y (to its left), z (up), and a turn about the vertical
DIRECTIONS: Mapping[str, Array] = {
    "w": np.array([1.0, 0, 0, 0]),
    "s": np.array([-1.0, 0, 0, 0]),
    "a": np.array([0, 1.0, 0, 0]),
    "d": np.array([0, -1.0, 0, 0]),
    "r": np.array([0, 0, 1.0, 0]),
    "f": np.array([0, 0, -1.0, 0]),
    "q": np.array([0, 0, 0, 1.0]),
    "e": np.array([0, 0, 0, -1.0]),
}
GRIPPER, DONE, GIVE_UP = " ", "\n", "x"
SCALE = np.array([SPEED_M_S, SPEED_M_S, SPEED_M_S, TURN_RAD_S])


class JoggedPanda(SimulatedPanda):
    """The arm of a task's scene under a person's keys; simulated time passes by ticks of 20 ms."""

    def __init__(self, task: SimTask) -> None:
        super().__init__(task, cameras=())
        self._wanted = self.hand
        self._velocity: Array = np.zeros(4)

    def switch_gripper(self) -> None:
        """Close the fingers, or open them; they take a while."""
        opens = not self.gripper_commanded_open
        self.task.data.ctrl[panda.GRIPPER_CTRL] = panda.FINGER_TRAVEL_M if opens else 0.0

    def tick(self, direction: Array) -> None:
        """Let 20 ms pass, the hand going in a direction (4,): x, y, z and about z, 1 being the full speed.

        At the end of the arm's reach, and against something firm, it stays where it is.
        """
        self._velocity = self._velocity + (SCALE * direction - self._velocity) * (1 - np.exp(-TICK_S / RAMP_S))
        moved = self._moved()
        joints = self._kinematics.solve(moved, self._target_rad, ITERATIONS, self._target_rad)
        if joints is None or np.abs(joints - self._target_rad).max() > MAX_STEP_RAD or self._blocked(moved):
            self._velocity, joints = np.zeros(4), self._target_rad
        else:
            self._wanted = moved
        parts = np.arange(1, round(TICK_S / TIMESTEP_S) + 1)[:, None] * TIMESTEP_S / TICK_S
        ahead = VELOCITY_LEAD_S * (joints - self._target_rad) / TICK_S
        self._run(self._target_rad + parts * (joints - self._target_rad) + ahead)
        self._target_rad = joints

    def _moved(self) -> ToolPose:
        turn = Rotation.from_euler("z", self._velocity[3] * TICK_S)
        return ToolPose(self._wanted.position_m + self._velocity[:3] * TICK_S, turn * self._wanted.rotation)

    def _blocked(self, moved: ToolPose) -> bool:
        behind_m, before_m = (self.hand.apart(pose)[0] for pose in (moved, self._wanted))
        return behind_m > MAX_LEAD_M and behind_m > before_m


class _Held:
    """Since when, and until when, each key counts as held."""

    def __init__(self) -> None:
        self._spans_s: dict[str, tuple[float, float]] = {}

    def press(self, key: str, now_s: float) -> None:
        since_s, until_s = self._spans_s.get(key, (now_s, now_s))
        self._spans_s[key] = (since_s if now_s < until_s else now_s, now_s + HELD_S)

    def direction(self, now_s: float) -> Array:
        """(4,) as `JoggedPanda.tick` takes it."""
        total: Array = np.zeros(4)
        for key, (since_s, until_s) in self._spans_s.items():
            if now_s < until_s:
                total = total + min(1.0, TAPPED_SHARE + (now_s - since_s) / FULL_AFTER_S) * DIRECTIONS[key]
        return total


def drive(
    arm: JoggedPanda, pressed: Callable[[], str], on_first: Callable[[], None], on_tick: Callable[[], None]
) -> bool:
    """Let a person move the arm until they are done; whether what they did is to be kept.

    Args:
        pressed: the keys pressed since it was called last.
        on_first: called before the first key that does something.
        on_tick: called after each tick.
    """
    keys = _Held()
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
