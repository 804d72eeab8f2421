"""Demonstrations by a task's expert, and rollouts of predicted actions, on scenes drawn from seeds.

Arguments and results can be pickled: call these functions from worker processes.
"""

from collections.abc import Sequence
from typing import Literal

from app.sim.guided import GuidedPanda, Habits
from app.sim.moves import Move, action_from_move, moves_from_actions
from app.sim.outcomes import RecordedDemonstration, RolloutResult, SceneView
from app.sim.robot import CONTROL_FREQUENCY_HZ, SimulatedPanda, TrajectorySampler
from app.sim.tasks import make_task
from app.sim.tasks.base import FINAL_HOLD_S, NOT_SOLVED
from app.sim.world import CAMERA_NAMES
from roboprompt_client.errors import MotionError
from roboprompt_client.types.poses import EndEffectorAction

# How experts are recorded: at rest at each of their poses, or passing them as a person does (`app.sim.guided`)
Recordings = Literal["rests", "continuous"]


def view_scene(
    task_name: str, seed: int, *, variation: int | None = None, cameras: Sequence[str] = CAMERA_NAMES
) -> SceneView:
    """The scene of a seed, as `record_demonstration` and `rollout` set it up.

    Args:
        cameras: of `app.sim.world.CAMERAS`, that take images; may be empty.

    Raises:
        InvalidInputError: for an unknown task or variation.
    """
    return _view(SimulatedPanda(make_task(task_name, seed, variation), cameras), seed)


def record_demonstration(
    task_name: str,
    seed: int,
    *,
    variation: int | None = None,
    recordings: Recordings = "rests",
    cameras: Sequence[str] = CAMERA_NAMES,
) -> RecordedDemonstration:
    """Record the task's expert in the scene of a seed; a failed demonstration has the reason.

    Args:
        recordings: whether the arm rests at each of the expert's poses, or passes them as a person does. The gripper's
            state is what was commanded where it rests, otherwise what the fingers have done.
        cameras: as for `view_scene`.

    Raises:
        InvalidInputError: for an unknown task or variation.
    """
    task = make_task(task_name, seed, variation)
    if recordings == "rests":
        robot = SimulatedPanda(task, cameras)
    else:
        habits = Habits(seed)
        task.way = habits.choose(task.ways)
        robot = GuidedPanda(task, habits, cameras)
    sampler = TrajectorySampler(robot, task.object_names)
    scene = _view(robot, seed)
    moves = task.expert()
    _, error = _perform(robot, moves)
    trajectory = sampler.trajectory("commanded" if recordings == "rests" else "measured")
    failure = error or judge(robot)
    actions = tuple(map(action_from_move, moves))
    return RecordedDemonstration(scene, trajectory, CONTROL_FREQUENCY_HZ, not failure, failure, actions)


def rollout(
    task_name: str, seed: int, actions: Sequence[EndEffectorAction], *, variation: int | None = None
) -> RolloutResult:
    """Carry out predicted actions on the scene of a seed and judge the outcome.

    An action that is out of reach or blocked ends the rollout as a failure that names it.

    Raises:
        InvalidInputError: for an unknown task or variation.
    """
    robot = SimulatedPanda(make_task(task_name, seed, variation), cameras=())
    num_executed, error = _perform(robot, moves_from_actions(actions))
    failure = error or judge(robot)
    return RolloutResult(num_executed, not failure, failure)


def _view(robot: SimulatedPanda, seed: int) -> SceneView:
    task, observation = robot.task, robot.observe()
    seen = (observation.objects, observation.frames, task.mask_ids(), observation.end_effector)
    return SceneView(task.name, seed, task.instruction, *seen)


def _perform(robot: SimulatedPanda, moves: Sequence[Move]) -> tuple[int, str]:
    """Return the number of moves carried out and the error that ended them (empty: none)."""
    done: list[int] = []
    robot.after_move.append(done.append)
    try:
        robot.perform(moves)
    except MotionError as error:
        return len(done), str(error)
    return len(done), ""


def judge(robot: SimulatedPanda) -> str:
    """Why the scene is not solved once things came to rest; empty if it is."""
    robot.hold(FINAL_HOLD_S)
    return "" if robot.task.succeeded() else NOT_SOLVED
