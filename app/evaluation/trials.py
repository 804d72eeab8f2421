"""One trial: ask for actions in an unseen scene, by the source that the method names, and carry them out."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.evaluation.failures import ProgramRefusedError
from app.evaluation.ledger import poses_of
from app.evaluation.methods import Method, Source
from app.evaluation.panda import WORLD as PANDA
from app.evaluation.panda import Actions, binned_keyframes
from app.evaluation.paper import disturbed
from app.evaluation.results import Trial
from app.evaluation.robot_loops import USELESS_REPLY, run_loop
from app.evaluation.teach import UNSEEN, Lesson, TaughtEpisode, images_only
from app.evaluation.voxposer.ask import Models, ask_for_program, oracle_actions, program_actions
from app.evaluation.world import World, timed
from app.executors import Executor, call
from app.pipeline.geometry import canonical_pose
from app.pipeline.workspace import Workspace
from app.sim.outcomes import RolloutResult, SceneView
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation
from roboprompt_client.types.poses import ObjectPose

# The problems that say of an instruction, not of the service, that it is not understood
REFUSED = frozenset({"/problems/ungrounded-instruction", "/problems/unfamiliar-instruction"})
LEVER_M = 0.1  # a turn counts as far as it moves a point at this distance; the length of KAT's triplets


class PlannedTrial(NamedTuple):
    """A trial to be run."""

    task: str
    seed: int
    method: Method

    @property
    def key(self) -> tuple[str, int, str]:
        """Task, seed and the method's label, which no two trials of a plan have in common."""
        return self.task, self.seed, self.method.label


@dataclass(frozen=True, eq=False)
class TrialRunner:
    """Runs trials in threads, so that the LLM answers the next while the last is executed.

    Attributes:
        asking: held while the LLM is asked, so that it is not asked for more at once than it should be.
        models: for methods that ask an LLM without the service; None where no method does.
    """

    client: RoboPromptClient
    executor: Executor
    world: World = PANDA
    asking: threading.Semaphore = field(default_factory=threading.Semaphore)
    models: Models | None = None

    def run(self, planned: PlannedTrial, lesson: Lesson) -> Trial:
        """Run a trial.

        Args:
            lesson: what its method was taught.

        Raises:
            ServiceProblemError, ServiceUnreachableError, LanguageModelError, or what a worker raised: nothing is known
                about the method.
        """
        return SOURCES[planned.method.source](self, planned, lesson, self.look(planned))

    def look(self, planned: PlannedTrial) -> SceneView:
        """The scene of the trial, without pictures."""
        return call(self.executor, self.world.view, planned.task, planned.seed)

    def execute(self, trial: Trial, actions: Actions) -> Trial:
        """The trial with what became of the actions."""
        execution, seconds = call(self.executor, timed, self.world.execute, trial.scene, actions)
        return replace(trial, actions=actions, execution=execution, execute_s=seconds)


def _ask_service(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    trial = Trial(*planned.key, scene)
    seen, options = _seen(runner, planned, scene), planned.method.options
    with runner.asking:
        started = time.perf_counter()
        try:
            predicted = runner.client.predict(lesson.name, scene.instruction, seen, **options)
        except ServiceProblemError as error:
            seconds, problem = time.perf_counter() - started, error.problem.get("type")
            unseen = planned.method.poses == "vision" and problem in UNSEEN
            if problem not in USELESS_REPLY | REFUSED and not unseen:
                raise
            answer = _without_actions(runner.client, error) if problem in USELESS_REPLY else None
            return replace(trial, answer=answer, error=str(error), predict_s=seconds, refused=problem in REFUSED)
        trial = replace(trial, answer=predicted.response, predict_s=time.perf_counter() - started)
    trial = runner.execute(trial, predicted.actions)
    runner.client.record_outcome(predicted.id, trial.succeeded, trial.failure or None)
    return trial


def _seen(runner: TrialRunner, planned: PlannedTrial, scene: SceneView) -> Observation:
    """What the robot sends of the scene."""
    if planned.method.poses == "vision":
        photographed = call(runner.executor, runner.world.view, planned.task, planned.seed, True)
        return images_only(photographed.frames, scene.objects)
    return Observation(_observed(planned, scene))


def _observed(planned: PlannedTrial, scene: SceneView) -> tuple[ObjectPose, ...]:
    """The objects with the method's noise."""
    return disturbed(scene.objects, planned.method.noise, planned.seed)


def _without_actions(client: RoboPromptClient, error: ServiceProblemError) -> dict[str, Any]:
    """What the service keeps of a prediction without actions, in the form of an answer."""
    stored = client.get(f"/predictions/{error.problem['prediction_id']}")
    timings = stored["timings_ms"]
    outside_llm_ms = sum(ms for name, ms in timings.items() if name != "llm")
    return {**stored, "actions": [], "timings_ms": {**timings, "outside_llm": outside_llm_ms}}


def _ask_and_act(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    """With the robot's own loop, in one worker: it asks before every action, or once and perhaps looks again."""
    with runner.asking:
        return call(runner.executor, run_loop, runner.client.url, lesson.name, planned.seed, planned.method, scene)


def _replay_nearest(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    taught = lesson.taught[: planned.method.options.get("num_demonstrations", lesson.num_demonstrations)]
    symmetry = runner.world.tasks[planned.task]
    actions = replayed(taught, scene.instruction, _observed(planned, scene), symmetry)
    return runner.execute(Trial(*planned.key, scene), actions)


def replayed(
    taught: Sequence[TaughtEpisode],
    instruction: str,
    objects: Sequence[ObjectPose],
    yaw_symmetry_deg: Mapping[str, float],
) -> Actions:
    """The keyframes that the service found in the demonstration whose object poses are nearest to `objects`.

    Only demonstrations of the same instruction are considered, where there are any. The distance is the sum over the
    objects of their shifts in meters and of their turns times 10 cm, up to their symmetry.
    """
    alike = [item for item in taught if item.recorded.scene.instruction == instruction] or list(taught)
    observed = {pose.name: canonical_pose(pose, yaw_symmetry_deg.get(pose.name)) for pose in objects}

    def distance_m(item: TaughtEpisode) -> float:
        poses = poses_of(item.document)
        return sum(_distance_m(canonical_pose(p, yaw_symmetry_deg.get(p.name)), observed[p.name]) for p in poses)

    nearest = min(alike, key=distance_m)
    return tuple(nearest.recorded.trajectory.action_at(item["index"]) for item in nearest.document["keyframes"])


def _distance_m(a: ObjectPose, b: ObjectPose) -> float:
    shift_m = float(np.linalg.norm(a.position_m - b.position_m))
    if a.quaternion_xyzw is None or b.quaternion_xyzw is None:
        return shift_m
    turn_rad = (Rotation.from_quat(a.quaternion_xyzw).inv() * Rotation.from_quat(b.quaternion_xyzw)).magnitude()
    return shift_m + LEVER_M * float(turn_rad)


def _replay_own(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    """A demonstration's keyframes in its own scene: what keyframes and execution leave to any prediction."""
    demonstration = lesson.taught[planned.seed % len(lesson.taught)]
    keyframes = runner.client.get(f"/episodes/{demonstration.document['id']}")["keyframes"]
    trajectory = demonstration.recorded.trajectory
    # A keyframe has its own state of the gripper: it may stand a moment before or after the recorded switch.
    actions = tuple(replace(trajectory.action_at(k["index"]), gripper_open=k["gripper_open"]) for k in keyframes)
    return runner.execute(Trial(*planned.key, demonstration.recorded.scene), actions)


def _replay_expert(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    """The ceiling of any method that predicts the expert's keyframes in bins: these keyframes themselves."""
    actions = call(runner.executor, binned_keyframes, planned.task, planned.seed)
    return runner.execute(Trial(*planned.key, scene), actions)


def _perform_expert(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    """The scene solved as demonstrations are: how often could it be taught at all?"""
    solved, seconds = call(runner.executor, timed, runner.world.solve, planned.task, planned.seed)
    actions = solved.expert_actions
    execution = RolloutResult(len(actions), solved.succeeded, solved.failure)
    return Trial(*planned.key, scene, execution=execution, execute_s=seconds, actions=actions)


def _ask_for_program(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    """The baseline after VoxPoser; a program that is refused counts as a failure, with prompt and reply."""
    assert runner.models is not None
    symmetry, box = runner.world.tasks[planned.task], runner.client.get(f"/tasks/{lesson.name}")["workspace"]
    objects = tuple(canonical_pose(pose, symmetry.get(pose.name)) for pose in _observed(planned, scene))
    with runner.asking:
        model = planned.method.options.get("model")
        completion, answer = ask_for_program(runner.models, model, objects, scene.instruction)
    trial = Trial(*planned.key, scene, answer=answer)
    workspace = Workspace(np.array(box["min"]), np.array(box["max"]))
    return _planned(runner, trial, program_actions, completion, replace(scene, objects=objects), workspace)


def _plan_oracle(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    """The baseline's planner with the program of a person; a program that it refuses counts as a failure."""
    seen = replace(scene, objects=_observed(planned, scene))
    return _planned(runner, Trial(*planned.key, scene), oracle_actions, seen)


def _planned(runner: TrialRunner, trial: Trial, plan: Callable[..., Actions], *arguments: object) -> Trial:
    """The trial with the plan of a program carried out."""
    started = time.perf_counter()
    try:
        actions = call(runner.executor, plan, *arguments)
    except ProgramRefusedError as error:
        return replace(trial, error=str(error), predict_s=_asked_s(trial) + time.perf_counter() - started)
    return runner.execute(replace(trial, predict_s=_asked_s(trial) + time.perf_counter() - started), actions)


def _asked_s(trial: Trial) -> float:
    return 0.0 if trial.answer is None else float(trial.answer["timings_ms"]["total"]) / 1000


SOURCES: Mapping[Source, Callable[[TrialRunner, PlannedTrial, Lesson, SceneView], Trial]] = {
    "service": _ask_service,
    "closed loop": _ask_and_act,
    "robot loop": _ask_and_act,
    "nearest demonstration": _replay_nearest,
    "own keyframes": _replay_own,
    "expert replay": _replay_expert,
    "expert": _perform_expert,
    "voxposer": _ask_for_program,
    "voxposer oracle": _plan_oracle,
}
