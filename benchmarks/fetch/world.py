"""Fetch of gymnasium-robotics as a world of the evaluation: `roboprompt eval --world benchmarks.fetch.world`.

A mobile manipulator reaches for a place, brings a block to a place on the table or above it, or pushes it there.
Scripted experts demonstrate; the one that pushes corrects its direction all the way. Predicted actions are carried out
straight from one to the next, and success is the environment's: at most 5 cm from the target in the end. It runs in an
environment of its own, since gymnasium-robotics needs another mujoco than the simulated Panda.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from app.sim.outcomes import RecordedDemonstration, RolloutResult, SceneView
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, Pose
from roboprompt_client.types.trajectory import Trajectory

Floats = NDArray[np.float64]
CONTROL_HZ = 25.0
DOWNWARD_XYZW = (1.0, 0.0, 0.0, 0.0)  # Fetch's hand never turns
OPEN, CLOSE = 1.0, -1.0  # the gripper's command
OPEN_M = 0.075  # between the fingers: they are open beyond it; the block is 5 cm wide
SOLVED_M = 0.05
NEAR_M = 0.08  # a block that starts as near to its target needs no push
STEP_M = 0.05  # of the hand at the full command
ARRIVED_M = 0.006
MOVE_STEPS, GRIP_STEPS, LAST_STEPS, SETTLE_STEPS, PUSH_STEPS = 80, 12, 15, 10, 150
ABOVE_M = np.array([0.0, 0.0, 0.08])  # the hand over a block
BEHIND_M = 0.09  # the hand behind a block that it pushes
STOPS_M = 0.012  # before the target along the line of the push
LEAD_M, ASIDE_GAIN = 0.015, 0.4  # of a push: the step ahead, and the share of the hand's error aside
JOINTS = ("shoulder_pan", "shoulder_lift", "upperarm_roll", "elbow_flex", "forearm_roll", "wrist_flex", "wrist_roll")


class Environment(Protocol):
    """One of gymnasium's, unwrapped. Everything that happens in it follows from the seed and the actions.

    Attributes:
        model, data: MuJoCo's.
    """

    model: Any
    data: Any

    def reset(self, *, seed: int) -> tuple[Mapping[str, Floats], Any]:
        """Begin the scene of that seed: the observation."""

    def step(self, action: Floats) -> tuple[Mapping[str, Floats], float, bool, bool, Any]:
        """Take one step by a command (4) of the hand's motion and the gripper: the observation first."""


@dataclass(frozen=True)
class Task:
    """One of Fetch's environments.

    Attributes:
        environment: its name in gymnasium.
        block: the name of what is moved; empty where nothing is.
        grips: whether the fingers move; they stay closed otherwise.
    """

    environment: str
    instruction: str
    expert: "Callable[[Run, float], None]"
    block: str = "black block"
    grips: bool = False


class Run:
    """A scene under way, and what a recorder sees of it.

    Attributes:
        block_m, target_m: (3,) at first; without a block the hand's place.
    """

    def __init__(self, task: str, seed: int) -> None:
        self.task, self._env = TASKS[task], _environment(TASKS[task].environment)
        self._seen: Mapping[str, Floats] = self._env.reset(seed=seed)[0]
        for _ in range(SETTLE_STEPS):
            self._seen = self._env.step(np.zeros(4))[0]
        self.gripper = OPEN if self.task.grips else CLOSE
        self.target_m = self._seen["desired_goal"].copy()
        self.block_m = self._seen["achieved_goal"].copy()
        self._rows: list[tuple[Floats, Floats, float]] = []
        self._note()

    @property
    def hand_m(self) -> Floats:
        """(3,) of the gripper."""
        return self._seen["observation"][:3].copy()

    @property
    def to_target_m(self) -> Floats:
        """(3,) from where the block (or the hand) is to the target."""
        return self.target_m - self._seen["achieved_goal"]

    @property
    def done(self) -> bool:
        return bool(np.linalg.norm(self.to_target_m) < SOLVED_M)

    def step(self, way_m: Floats, speed: float = 1.0) -> None:
        """Move the hand along a way (3,) for one step, at most at a share `speed` of the fastest."""
        command = way_m / STEP_M
        command *= speed / max(speed, float(np.abs(command).max()))
        self._seen = self._env.step(np.append(command, self.gripper))[0]
        self._note()

    def go(self, position_m: Floats, speed: float = 1.0, within_m: float = ARRIVED_M) -> None:
        """Move the hand straight to a position (3,)."""
        for _ in range(MOVE_STEPS):
            if np.linalg.norm(position_m - self.hand_m) < within_m:
                return
            self.step(position_m - self.hand_m, speed)

    def hold(self, steps: int) -> None:
        """Stay where the hand is."""
        here_m = self.hand_m
        for _ in range(steps):
            self.step(here_m - self.hand_m)

    def view(self, task: str, seed: int) -> SceneView:
        """Return the scene; call it before the hand moves."""
        objects: tuple[ObjectPose, ...] = (ObjectPose("red target", self.target_m, None),)
        if self.task.block:
            turn = Rotation.from_euler("xyz", self._seen["observation"][11:14])
            objects = (ObjectPose(self.task.block, self.block_m, turn.as_quat()), *objects)
        return SceneView(task, seed, self.task.instruction, objects, (), {}, Pose(self.hand_m, DOWNWARD_XYZW))

    def trajectory(self) -> Trajectory:
        velocities_rad_s, places_m, widths_m = (np.array(column) for column in zip(*self._rows, strict=True))
        downward = np.tile(DOWNWARD_XYZW, (len(places_m), 1))
        return Trajectory(velocities_rad_s, places_m, downward, widths_m > OPEN_M)

    def _note(self) -> None:
        seen, model, data = self._seen["observation"], self._env.model, self._env.data
        joints = [model.joint(f"robot0:{name}_joint").dofadr[0] for name in JOINTS]
        fingers = seen[9:11] if self.task.block else seen[3:5]
        self._rows.append((data.qvel[joints].copy(), self.hand_m, float(fingers.sum())))


def reach(run: Run, speed: float) -> None:
    """Go to the target."""
    run.go(run.target_m, speed)
    run.hold(LAST_STEPS)


def place(run: Run, speed: float) -> None:
    """Take the block from above, and hold it at the target."""
    above_m = run.block_m + ABOVE_M
    run.go(above_m, speed, within_m=2 * ARRIVED_M)
    run.go(run.block_m, 0.7 * speed)
    run.gripper = CLOSE
    run.hold(GRIP_STEPS)
    run.go(above_m, speed, within_m=2 * ARRIVED_M)
    run.go(run.target_m, speed)
    run.hold(LAST_STEPS)


def push(run: Run, speed: float) -> None:
    """Rise, come down behind the block, push it, and steer toward the line from block to target all the way."""
    way_m = np.append((run.target_m - run.block_m)[:2], 0.0)
    ahead = way_m / np.linalg.norm(way_m)
    behind_m = run.block_m - BEHIND_M * ahead
    for over_m in (run.hand_m, behind_m):  # at first the hand is as low as the block
        run.go(over_m + ABOVE_M, speed, within_m=2 * ARRIVED_M)
    run.go(behind_m, speed)
    for _ in range(PUSH_STEPS):
        to_target_m = np.append(run.to_target_m[:2], 0.0)
        if to_target_m @ ahead < STOPS_M:
            break
        toward = to_target_m / np.linalg.norm(to_target_m)
        from_block_m = run.hand_m - (run.target_m - run.to_target_m)
        aside_m = from_block_m - (from_block_m @ toward) * toward
        run.step(LEAD_M * toward - ASIDE_GAIN * aside_m, speed)
    run.hold(LAST_STEPS)


TASKS: Mapping[str, Task] = {
    "fetch_reach": Task("FetchReach-v4", "move the hand to the red target", reach, block=""),
    "fetch_place": Task("FetchPickAndPlace-v4", "bring the black block to the red target", place, grips=True),
    "fetch_push": Task("FetchPush-v4", "push the black block to the red target", push),
}


@dataclass(frozen=True)
class Fetch:
    """Three of Fetch's four tasks; in the fourth a stroke, whose speed counts, sends a puck out of reach."""

    tasks: ClassVar[Mapping[str, Mapping[str, float]]] = {task: {} for task in TASKS}
    first_test_seed: ClassVar[int] = 1000
    has_cameras: ClassVar[bool] = False
    python: ClassVar[Path | None] = Path(__file__).parent / ".venv" / "bin" / "python"

    def conditions(self) -> Mapping[str, Any]:
        return {"world": "fetch", "control_frequency_hz": CONTROL_HZ}

    def view(self, task: str, seed: int, images: bool = False) -> SceneView:
        return Run(task, seed).view(task, seed)

    def demonstrate(self, task: str, seed: int, images: bool = False) -> RecordedDemonstration:
        run = Run(task, seed)
        view, far = run.view(task, seed), np.linalg.norm(run.to_target_m) > NEAR_M
        run.task.expert(run, float(np.random.default_rng(seed).uniform(0.4, 0.7)))
        failure = "" if run.done else "the expert did not solve it"
        if not far:
            failure = "it was solved from the start"
        return RecordedDemonstration(view, run.trajectory(), CONTROL_HZ, not failure, failure)

    def solve(self, task: str, seed: int) -> RecordedDemonstration:
        return self.demonstrate(task, seed)

    def execute(self, scene: SceneView, actions: Sequence[EndEffectorAction]) -> RolloutResult:
        run = Run(scene.task, scene.seed)
        for action in actions:
            run.go(action.position_m)
            command = OPEN if action.gripper_open else CLOSE
            if run.task.grips and command != run.gripper:
                run.gripper = command
                run.hold(GRIP_STEPS)
        run.hold(LAST_STEPS)
        off_cm = 100 * float(np.linalg.norm(run.to_target_m))
        return RolloutResult(len(actions), run.done, "" if run.done else f"{off_cm:.0f} cm from the target in the end")


WORLD = Fetch()


@lru_cache(maxsize=1)
def _environment(name: str) -> Environment:
    """The worker's environment."""
    import gymnasium
    import gymnasium_robotics

    warnings.filterwarnings("ignore")
    gymnasium.register_envs(gymnasium_robotics)
    made: Environment = gymnasium.make(name, max_episode_steps=10**6).unwrapped
    return made
