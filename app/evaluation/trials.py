"""Runs one trial: gets actions for an unseen scene from the source that the method names, and carries them out."""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from app.evaluation.methods import Method, Source
from app.evaluation.panda import WORLD as PANDA
from app.evaluation.panda import Actions, binned_keyframes
from app.evaluation.paper import disturbed
from app.evaluation.results import Trial
from app.evaluation.robot_loops import USELESS_REPLY, run_loop
from app.evaluation.teach import UNSEEN, Lesson, images_only
from app.evaluation.world import World, timed
from app.executors import Executor, call
from app.sim.outcomes import RolloutResult, SceneView
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation

# Problem types that mean that the instruction was not understood.
REFUSED = frozenset({"/problems/ungrounded-instruction", "/problems/unfamiliar-instruction"})


class PlannedTrial(NamedTuple):
    """A trial to be run. Its `key` is unique within a plan."""

    task: str
    seed: int
    method: Method

    @property
    def key(self) -> tuple[str, int, str]:
        """Task, seed and the method's label."""
        return self.task, self.seed, self.method.label


@dataclass(frozen=True, eq=False)
class TrialRunner:
    """Runs trials. Call it from several threads: the LLM then answers one trial while another is simulated.

    Attributes:
        asking: limits how many threads ask the LLM at once.
    """

    client: RoboPromptClient
    executor: Executor
    world: World = PANDA
    asking: threading.Semaphore = field(default_factory=threading.Semaphore)

    def run(self, planned: PlannedTrial, lesson: Lesson) -> Trial:
        """Run a trial of a method that was taught `lesson`.

        Raises:
            ServiceProblemError, ServiceUnreachableError, LanguageModelError, or a worker's error: the trial does not
                count.
        """
        return SOURCES[planned.method.source](self, planned, lesson, self.look(planned))

    def look(self, planned: PlannedTrial) -> SceneView:
        """Return the trial's scene without pictures."""
        return call(self.executor, self.world.view, planned.task, planned.seed)

    def execute(self, trial: Trial, actions: Actions) -> Trial:
        """Return the trial after carrying out the actions."""
        execution, seconds = call(self.executor, timed, self.world.execute, trial.scene, actions)
        return replace(trial, actions=actions, execution=execution, execute_s=seconds)


def _ask_service(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    trial = Trial(*planned.key, scene)
    seen, options = _observation(runner, planned, scene), planned.method.options
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


def _observation(runner: TrialRunner, planned: PlannedTrial, scene: SceneView) -> Observation:
    """Return what the robot sends of the scene: poses with the method's noise, or images only."""
    if planned.method.poses == "vision":
        photographed = call(runner.executor, runner.world.view, planned.task, planned.seed, True)
        return images_only(photographed.frames, scene.objects)
    return Observation(disturbed(scene.objects, planned.method.noise, planned.seed))


def _without_actions(client: RoboPromptClient, error: ServiceProblemError) -> dict[str, Any]:
    """Return the stored record of a prediction without actions, in the form of an answer."""
    stored = client.get(f"/predictions/{error.problem['prediction_id']}")
    timings = stored["timings_ms"]
    outside_llm_ms = sum(ms for name, ms in timings.items() if name != "llm")
    return {**stored, "actions": [], "timings_ms": {**timings, "outside_llm": outside_llm_ms}}


def _ask_and_act(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    """Run the robot's own loop in a worker: it asks once, and may look again while it moves."""
    with runner.asking:
        return call(runner.executor, run_loop, runner.client.url, lesson.name, planned.seed, planned.method, scene)


def _replay_own(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    """Carry out a demonstration's keyframes in its own scene: an upper bound for any prediction."""
    demonstration = lesson.taught[planned.seed % len(lesson.taught)]
    keyframes = runner.client.get(f"/episodes/{demonstration.document['id']}")["keyframes"]
    trajectory = demonstration.recorded.trajectory
    # A keyframe stores the gripper's state: it may lie shortly before or after the recorded switch.
    actions = tuple(replace(trajectory.action_at(k["index"]), gripper_open=k["gripper_open"]) for k in keyframes)
    return runner.execute(Trial(*planned.key, demonstration.recorded.scene), actions)


def _replay_expert(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    """Carry out the expert's own keyframes in bins: an upper bound for methods that predict bins."""
    actions = call(runner.executor, binned_keyframes, planned.task, planned.seed)
    return runner.execute(Trial(*planned.key, scene), actions)


def _perform_expert(runner: TrialRunner, planned: PlannedTrial, lesson: Lesson, scene: SceneView) -> Trial:
    """Let the expert solve the scene: how often could the task be demonstrated at all?"""
    solved, seconds = call(runner.executor, timed, runner.world.solve, planned.task, planned.seed)
    actions = solved.expert_actions
    execution = RolloutResult(len(actions), solved.succeeded, solved.failure)
    return Trial(*planned.key, scene, execution=execution, execute_s=seconds, actions=actions)


SOURCES: Mapping[Source, Callable[[TrialRunner, PlannedTrial, Lesson, SceneView], Trial]] = {
    "service": _ask_service,
    "robot loop": _ask_and_act,
    "own keyframes": _replay_own,
    "expert replay": _replay_expert,
    "expert": _perform_expert,
}
