"""Meta-World as a world of the evaluation: `roboprompt eval --world benchmarks.metaworld.world`.

Its scripted policies demonstrate; predicted actions are carried out straight from one to the next, in Meta-World's own
scenes and by its own criterion of success. It runs in an environment of its own, since metaworld pins another mujoco
than the simulated Panda needs.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from app.sim.outcomes import RecordedDemonstration, RolloutResult, SceneView
from benchmarks.metaworld.tasks import FINGERS, HAND, TASKS, Command, Floats, observed_objects
from roboprompt_client.types.poses import EndEffectorAction, Pose
from roboprompt_client.types.trajectory import Trajectory

NUM_JOINTS = 7
OPEN, CLOSE = -1.0, 1.0  # the gripper's command
DOWNWARD_XYZW = (1.0, 0.0, 0.0, 0.0)  # Meta-World's hand never turns
AFTER_SUCCESS_STEPS = 5  # so long a demonstration goes on
CLEAR_TRAVEL = 0.1  # of the fingers: what moves less has neither opened nor closed
GAIN_PER_M = 10.0  # of the hand's command, which is clipped to a step's length
TOLERANCE_M, PRECISE_M = 0.01, 0.005  # on the way; where the gripper switches and at the end
MOVE_STEPS, GRIP_STEPS = 60, 15


class Simulation(Protocol):
    """The scenes of one task. Everything that happens follows from the seed and the actions.

    Attributes:
        step_hz: steps a second.
        max_steps: of a scene; after them it has failed.
    """

    step_hz: float
    max_steps: int

    def reset(self, seed: int) -> Floats:
        """Begin the scene of that seed; its observation (39)."""

    def step(self, command: Command) -> tuple[Floats, bool]:
        """Take one step, a command out of bounds clipped: the observation (39), and whether the task is done."""

    def policy(self, observation: Floats) -> Command:
        """The command of the scripted policy."""

    def joint_velocities_rad_s(self) -> Floats:
        """Of the seven joints."""


class MetaWorldSimulation:
    """Meta-World itself, with the goal in the observation."""

    def __init__(self, task: str) -> None:
        from metaworld.env_dict import ALL_V3_ENVIRONMENTS_GOAL_OBSERVABLE
        from metaworld.policies import ENV_POLICY_MAP

        warnings.filterwarnings("ignore")  # Meta-World warns of its own policies' large steps
        make_env: Any = ALL_V3_ENVIRONMENTS_GOAL_OBSERVABLE[f"{task}-v3-goal-observable"]
        make_policy: Any = ENV_POLICY_MAP[f"{task}-v3"]
        self._env = make_env(seed=0)
        self._env._freeze_rand_vec, self._env.seeded_rand_vec = False, True  # every seed is a scene of its own
        self._policy = make_policy()
        self.step_hz = 1 / self._env.dt
        self.max_steps = self._env.max_path_length - 1  # Meta-World refuses the step after the last

    def reset(self, seed: int) -> Floats:
        self._env.seed(seed)
        return np.asarray(self._env.reset()[0], np.float64)

    def step(self, command: Command) -> tuple[Floats, bool]:
        observation, _, _, _, info = self._env.step(np.clip(command, -1, 1))
        return np.asarray(observation, np.float64), bool(info["success"])

    def policy(self, observation: Floats) -> Command:
        with np.errstate(all="ignore"):
            # a copy: three of the policies write into what they get
            return np.asarray(self._policy.get_action(observation.copy()))

    def joint_velocities_rad_s(self) -> Floats:
        return np.array(self._env.data.qvel[:NUM_JOINTS])


@lru_cache(maxsize=1)
def simulation_of(task: str) -> Simulation:
    """The worker's simulation of a task."""
    return MetaWorldSimulation(task)


CONTROL_HZ = 27.0  # of the recordings, as near as every so many of the simulation's 80 steps a second come


@dataclass(frozen=True)
class MetaWorld:
    """Half of Meta-World's tasks."""

    tasks: ClassVar[Mapping[str, Mapping[str, float]]] = {task: {} for task in TASKS}
    first_test_seed: ClassVar[int] = 1000
    has_cameras: ClassVar[bool] = False
    python: ClassVar[Path | None] = Path(__file__).parent / ".venv" / "bin" / "python"

    def conditions(self) -> Mapping[str, Any]:
        return {"world": "metaworld", "control_frequency_hz": CONTROL_HZ}

    def view(self, task: str, seed: int, images: bool = False) -> SceneView:
        return _scene(task, seed, simulation_of(task).reset(seed))

    def demonstrate(self, task: str, seed: int, images: bool = False) -> RecordedDemonstration:
        simulation = simulation_of(task)
        every = max(1, round(simulation.step_hz / CONTROL_HZ))
        first, rows, done = _policy_run(simulation, seed)
        velocities, places_m, fingers = (np.array(column)[::every] for column in zip(*rows, strict=True))
        downward = np.tile(DOWNWARD_XYZW, (len(places_m), 1))
        trajectory = Trajectory(velocities, places_m, downward, gripper_open(fingers))
        failure = "" if done else f"the scripted policy did not succeed within {simulation.max_steps} steps"
        frequency_hz = simulation.step_hz / every
        return RecordedDemonstration(_scene(task, seed, first), trajectory, frequency_hz, done, failure)

    def solve(self, task: str, seed: int) -> RecordedDemonstration:
        return self.demonstrate(task, seed)

    def execute(self, scene: SceneView, actions: Sequence[EndEffectorAction]) -> RolloutResult:
        """Straight from one position to the next; rotations are left out, as the hand cannot turn."""
        arm = _Arm(simulation_of(scene.task), scene.seed)
        for number, action in enumerate(actions, start=1):
            arm.perform(action, is_last=number == len(actions))
        failure = "" if arm.done else f"not solved after {arm.steps} steps"
        return RolloutResult(len(actions), arm.done, failure)


WORLD = MetaWorld()


def gripper_open(fingers: Floats) -> NDArray[np.bool_]:
    """Whether the gripper is open, by what its fingers do, which is later than what they are commanded.

    The threshold lies between the extremes of the recording; fingers that hardly move have been open throughout.

    Args:
        fingers: (T) how far they are apart.
    """
    low, high = fingers.min(), fingers.max()
    if high - low <= CLEAR_TRAVEL:
        return np.ones(len(fingers), np.bool_)
    return np.asarray(fingers > (low + high) / 2)


def _scene(task: str, seed: int, observation: Floats) -> SceneView:
    hand = Pose(observation[HAND], DOWNWARD_XYZW)
    objects = observed_objects(TASKS[task], observation)
    return SceneView(task, seed, TASKS[task].instruction, objects, (), {}, hand)


def _policy_run(simulation: Simulation, seed: int) -> tuple[Floats, list[tuple[Floats, Floats, float]], bool]:
    """The first observation (39); of every step joint velocities (7), hand (3) and fingers; whether it succeeded."""
    first = observation = simulation.reset(seed)
    rows: list[tuple[Floats, Floats, float]] = []
    last_step, succeeded = simulation.max_steps, False
    while len(rows) < last_step:
        rows.append((simulation.joint_velocities_rad_s(), observation[HAND].copy(), float(observation[FINGERS])))
        observation, done = simulation.step(simulation.policy(observation))
        if done and not succeeded:
            succeeded = True
            last_step = min(last_step, len(rows) + AFTER_SUCCESS_STEPS)
    return first, rows, succeeded


class _Arm:
    """The hand under way in a scene; once the task is done or the steps are used up it stays."""

    def __init__(self, simulation: Simulation, seed: int) -> None:
        self._simulation = simulation
        self._hand_m = simulation.reset(seed)[HAND]
        self._gripper = OPEN
        self.steps = 0
        self.done = False

    def perform(self, action: EndEffectorAction, *, is_last: bool) -> None:
        command = OPEN if action.gripper_open else CLOSE
        settles = is_last or command != self._gripper
        self._move(action.position_m, MOVE_STEPS, PRECISE_M if settles else TOLERANCE_M)
        if settles:
            self._gripper = command
            self._move(action.position_m, GRIP_STEPS * (2 if is_last else 1), tolerance_m=None)

    def _move(self, target_m: Floats, max_steps: int, tolerance_m: float | None) -> None:
        """Towards a position (3); without a tolerance all steps are taken."""
        for _ in range(max_steps):
            error_m = target_m - self._hand_m
            arrived = tolerance_m is not None and np.linalg.norm(error_m) < tolerance_m
            if arrived or self.done or self.steps >= self._simulation.max_steps:
                return
            command = np.append(np.clip(GAIN_PER_M * error_m, -1, 1), self._gripper)
            observation, self.done = self._simulation.step(command)
            self._hand_m = observation[HAND]
            self.steps += 1
