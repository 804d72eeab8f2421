"""One scene under one method: predict over HTTP, execute in the simulation, tell the service how it went.

The baseline that only remembers asks nobody: it takes the demonstration whose scene is most like the one at hand.
"""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Generic, TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from app.evaluation.executors import Executor, call
from app.evaluation.oracle import oracle_actions
from app.evaluation.paper import disturbed
from app.evaluation.results import Method, Source, TaughtEpisode, Trial
from app.evaluation.robot_loops import USELESS_REPLY, ClosedLoopResult, run_in_closed_loop, run_in_robot_loop
from app.evaluation.teach import UNSEEN, Lesson, images_only
from app.pipeline.geometry import canonical_pose
from app.pipeline.keyframes import merged
from app.pipeline.order.similarity import Described, most_similar
from app.pipeline.workspace import Workspace, discretize_action, undiscretize_action
from app.sim.demonstrate import (
    RecordedDemonstration,
    Recordings,
    RobotName,
    RolloutResult,
    SceneView,
    record_demonstration,
    rollout,
    view_scene,
)
from app.sim.libfranka import demonstrate as over_libfranka
from app.sim.tasks import ALL_TASKS
from app.voxposer.errors import ProgramRefusedError
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

# The yardsticks among the backends: where they have no answer, that is no failure of a service
YARDSTICKS = frozenset({"nearest", "regression"})
# The problems that say of an instruction, not of the service, that it is not understood
REFUSED = frozenset({"/problems/ungrounded-instruction", "/problems/unfamiliar-instruction"})
LEVER_M = 0.1  # a turn counts as far as it moves a point at this distance; the length of KAT's triplets


def replayed(
    taught: Sequence[TaughtEpisode],
    instruction: str,
    objects: Sequence[ObjectPose],
    yaw_symmetry_deg: Mapping[str, float],
) -> tuple[EndEffectorAction, ...]:
    """The keyframes that the service found in the demonstration whose object poses are nearest to `objects`.

    Only demonstrations of the same instruction are considered, where there are any. The distance is the sum over the
    objects of their shifts in metres and of their turns times 10 cm, up to their symmetry.
    """
    alike = [item for item in taught if item.recorded.scene.instruction == instruction] or list(taught)
    observed = {pose.name: canonical_pose(pose, yaw_symmetry_deg.get(pose.name)) for pose in objects}

    def distance_m(item: TaughtEpisode) -> float:
        poses = [ObjectPose(o["name"], o["position"], o["quaternion_xyzw"]) for o in item.document["objects"]]
        return sum(_distance_m(canonical_pose(p, yaw_symmetry_deg.get(p.name)), observed[p.name]) for p in poses)

    nearest = min(alike, key=distance_m)
    return tuple(nearest.recorded.trajectory.action_at(item["index"]) for item in nearest.document["keyframes"])


def _distance_m(a: ObjectPose, b: ObjectPose) -> float:
    shift_m = float(np.linalg.norm(a.position_m - b.position_m))
    if a.quaternion_xyzw is None or b.quaternion_xyzw is None:
        return shift_m
    turn_rad = (Rotation.from_quat(a.quaternion_xyzw).inv() * Rotation.from_quat(b.quaternion_xyzw)).magnitude()
    return shift_m + LEVER_M * float(turn_rad)


@dataclass(frozen=True)
class Cell:
    """A trial to be run."""

    task: str
    seed: int
    method: Method


@dataclass(frozen=True, eq=False)
class Laboratory:
    """What trials share. They run in threads, so that the LLM answers the next while the last is executed.

    Attributes:
        asking: held while the LLM is asked, so that it is not asked for more at once than it should be.
        recordings: how experts that are tried solve their scenes.
        robot: what carries out actions that are asked for as a whole.
        lending: by task what each was taught, for tasks that are taught nothing.
    """

    client: RoboPromptClient
    executor: Executor
    asking: threading.Semaphore = field(default_factory=threading.Semaphore)
    recordings: Recordings = "rests"
    robot: RobotName = "simulated"
    lending: Mapping[str, Lesson] = field(default_factory=dict)

    def run(self, cell: Cell, lesson: Lesson) -> Trial:
        """Run the trial of `cell`.

        Args:
            lesson: what the cell's method was taught.

        Raises:
            ServiceProblemError, ServiceUnreachableError, or what a worker raised: nothing is known about the method.
        """
        return SOURCES[cell.method.source](self, cell, lesson, self.look(cell))

    def options(self, cell: Cell, scene: SceneView) -> dict[str, Any]:
        """What the cell's method asks for; of an unseen task the demonstrations of the most similar other tasks."""
        if not cell.method.unseen:
            return dict(cell.method.options)
        others = [(task, _described(lesson.taught[-1].recorded.scene)) for task, lesson in self.lending.items()]
        similar = most_similar(_described(scene), [item for item in others if item[0] != cell.task])
        return {**cell.method.options, "demonstrations_from": [self.lending[task].name for task in similar]}

    def look(self, cell: Cell) -> SceneView:
        """The scene of the trial, without pictures."""
        return call(self.executor, _view, cell.task, cell.seed)

    def execute(self, trial: Trial, actions: tuple[EndEffectorAction, ...]) -> Trial:
        """The trial with what became of the actions."""
        timed = call(self.executor, _execute, trial.task, trial.seed, actions, self.robot)
        return replace(trial, actions=actions, execution=timed.result, execute_s=timed.seconds)


def _ask_service(laboratory: Laboratory, cell: Cell, lesson: Lesson, scene: SceneView) -> Trial:
    trial = Trial(cell.task, cell.seed, cell.method.label, scene)
    seen, options = _seen(laboratory, cell, scene), laboratory.options(cell, scene)
    with laboratory.asking:
        started = time.perf_counter()
        try:
            predicted = laboratory.client.predict(lesson.name, scene.instruction, seen, **options)
        except ServiceProblemError as error:
            seconds, problem = time.perf_counter() - started, error.problem.get("type")
            unseen = cell.method.poses == "vision" and problem in UNSEEN
            if problem not in USELESS_REPLY | REFUSED and not unseen and not _has_no_answer(cell.method, problem):
                raise
            answer = _without_actions(laboratory.client, error) if problem in USELESS_REPLY else None
            return replace(trial, answer=answer, error=str(error), predict_s=seconds, refused=problem in REFUSED)
        trial = replace(trial, answer=predicted.response, predict_s=time.perf_counter() - started)
    trial = laboratory.execute(trial, predicted.actions)
    laboratory.client.record_outcome(predicted.id, trial.succeeded, trial.failure or None)
    return trial


def _has_no_answer(method: Method, problem: str | None) -> bool:
    """Whether a yardstick found no demonstration like the question among those of other tasks."""
    return method.unseen and method.options.get("model") in YARDSTICKS and problem == "/problems/model-error"


def _described(scene: SceneView) -> Described:
    return Described(scene.instruction, tuple(pose.name for pose in scene.objects))


def _seen(laboratory: Laboratory, cell: Cell, scene: SceneView) -> Observation:
    """What the robot tells the service of the scene."""
    if cell.method.poses == "vision":
        return images_only(call(laboratory.executor, _photograph, cell.task, cell.seed), scene.objects)
    start = scene.end_effector if cell.method.options.get("method") == "voxposer" else None
    return Observation(disturbed(scene.objects, cell.method.noise, cell.seed), end_effector=start)


def _without_actions(client: RoboPromptClient, error: ServiceProblemError) -> dict[str, Any]:
    """What the service keeps of a prediction without actions, in the form of an answer."""
    stored = client.get(f"/predictions/{error.problem['prediction_id']}")
    timings = stored["timings_ms"]
    outside_llm_ms = sum(ms for name, ms in timings.items() if name != "llm")
    return {**stored, "actions": [], "timings_ms": {**timings, "outside_llm": outside_llm_ms}}


def _ask_step_by_step(laboratory: Laboratory, cell: Cell, lesson: Lesson, scene: SceneView) -> Trial:
    url, options = laboratory.client.url, dict(cell.method.options)
    with laboratory.asking:
        result: ClosedLoopResult = call(
            laboratory.executor, run_in_closed_loop, url, lesson.name, cell.task, cell.seed, cell.method.noise, options
        )
    return _looped(cell, scene, result)


def _ask_and_act(laboratory: Laboratory, cell: Cell, lesson: Lesson, scene: SceneView) -> Trial:
    """With the robot's own loop, which looks again where the method says so."""
    url, method = laboratory.client.url, cell.method
    how = (method.noise, dict(method.options), method.shift_m, method.look_again, method.lead_s)
    with laboratory.asking:
        result: ClosedLoopResult = call(
            laboratory.executor, run_in_robot_loop, url, lesson.name, cell.task, cell.seed, *how
        )
    return replace(_looped(cell, scene, result), shift_m=method.shift_m)


def _looped(cell: Cell, scene: SceneView, result: ClosedLoopResult) -> Trial:
    """The trial of a loop that asked and acted in one worker."""
    predict_s = 0.0 if result.answer is None else result.answer["timings_ms"]["total"] / 1000
    return Trial(
        cell.task,
        cell.seed,
        cell.method.label,
        scene,
        answer=result.answer,
        error=result.error,
        execution=None if result.error else result.execution,
        predict_s=predict_s,
        execute_s=result.duration_s - predict_s,
        actions=result.actions,
    )


def _replay_nearest(laboratory: Laboratory, cell: Cell, lesson: Lesson, scene: SceneView) -> Trial:
    seen = disturbed(scene.objects, cell.method.noise, cell.seed)
    taught = lesson.taught[: cell.method.options.get("num_demonstrations", lesson.num_demonstrations)]
    actions = replayed(taught, scene.instruction, seen, ALL_TASKS[cell.task].yaw_symmetry_deg)
    return laboratory.execute(Trial(cell.task, cell.seed, cell.method.label, scene), actions)


def _replay_expert(laboratory: Laboratory, cell: Cell, lesson: Lesson, scene: SceneView) -> Trial:
    """The ceiling of any method that predicts the expert's keyframes in bins: these keyframes themselves."""
    actions = call(laboratory.executor, _binned_expert, cell.task, cell.seed)
    return laboratory.execute(Trial(cell.task, cell.seed, cell.method.label, scene), actions)


def _perform_expert(laboratory: Laboratory, cell: Cell, lesson: Lesson, scene: SceneView) -> Trial:
    """The scene solved as demonstrations are: how often could it be taught at all?"""
    timed = call(laboratory.executor, _expert, cell.task, cell.seed, laboratory.recordings)
    execution, actions = timed.result
    return Trial(
        cell.task, cell.seed, cell.method.label, scene, execution=execution, execute_s=timed.seconds, actions=actions
    )


def _plan_oracle(laboratory: Laboratory, cell: Cell, lesson: Lesson, scene: SceneView) -> Trial:
    """The baseline's planner with the program of a person; a program that it refuses counts as a failure."""
    trial = Trial(cell.task, cell.seed, cell.method.label, scene)
    seen = disturbed(scene.objects, cell.method.noise, cell.seed)
    started = time.perf_counter()
    try:
        actions: _Actions = call(laboratory.executor, oracle_actions, replace(scene, frames=(), objects=seen))
    except ProgramRefusedError as error:
        return replace(trial, error=str(error), predict_s=time.perf_counter() - started)
    return laboratory.execute(replace(trial, predict_s=time.perf_counter() - started), actions)


_Run = Callable[[Laboratory, Cell, Lesson, SceneView], Trial]
SOURCES: Mapping[Source, _Run] = {
    "service": _ask_service,
    "closed loop": _ask_step_by_step,
    "robot loop": _ask_and_act,
    "nearest demonstration": _replay_nearest,
    "expert replay": _replay_expert,
    "expert": _perform_expert,
    "voxposer oracle": _plan_oracle,
}


_Actions = tuple[EndEffectorAction, ...]
_Result = TypeVar("_Result")


@dataclass(frozen=True, eq=False)
class _Timed(Generic[_Result]):
    result: _Result
    seconds: float


# What follows runs in workers. Pictures take longer than the simulation; `app.evaluation.illustrate` takes them later.


@lru_cache(maxsize=64)
def _view(task: str, seed: int) -> SceneView:
    return view_scene(task, seed, variation=ALL_TASKS[task].test_variation(seed), images=False)


def _photograph(task: str, seed: int) -> tuple[RgbdFrame, ...]:
    return view_scene(task, seed, variation=ALL_TASKS[task].test_variation(seed)).frames


def _execute(task: str, seed: int, actions: _Actions, robot: RobotName) -> _Timed[RolloutResult]:
    started, carry_out = time.perf_counter(), over_libfranka.rollout if robot == "franka" else rollout
    result = carry_out(task, seed, actions, variation=ALL_TASKS[task].test_variation(seed))
    return _Timed(result, time.perf_counter() - started)


def _expert(task: str, seed: int, recordings: Recordings) -> _Timed[tuple[RolloutResult, _Actions]]:
    started = time.perf_counter()
    variation = ALL_TASKS[task].test_variation(seed)
    recorded = record_demonstration(task, seed, variation=variation, images=False, recordings=recordings)
    actions = _keyframe_actions(recorded) if recordings == "rests" else recorded.expert_actions
    result = RolloutResult(task, seed, len(actions), recorded.succeeded, recorded.failure, ())
    return _Timed((result, actions), time.perf_counter() - started)


def _binned_expert(task: str, seed: int) -> _Actions:
    recorded = record_demonstration(task, seed, variation=ALL_TASKS[task].test_variation(seed), images=False)
    workspace = Workspace.rlbench()
    binned = [discretize_action(action, workspace).bins for action in _keyframe_actions(recorded)]
    return tuple(undiscretize_action(bins, workspace) for bins in binned)


def _keyframe_actions(recorded: RecordedDemonstration) -> _Actions:
    trajectory = recorded.trajectory
    return tuple(trajectory.action_at(index) for index in merged(trajectory))
