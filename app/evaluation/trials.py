"""Runs one trial: gets actions for an unseen scene from the source that the method names, and carries them out."""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from app.evaluation.methods import Method, Source
from app.evaluation.paper import disturbed
from app.evaluation.plan import PlannedTrial
from app.evaluation.results import Trial
from app.evaluation.robot_loop import USELESS_REPLY, run_loop
from app.evaluation.teach import UNSEEN, Lesson, images_only
from app.evaluation.world import WORLD, Actions, World, binned_keyframes
from app.executors import Executor, call, timed
from app.sim.outcomes import RolloutResult, SceneView
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation

# Problem types that mean that the instruction was not understood.
REFUSED = frozenset({"/problems/ungrounded-instruction", "/problems/unfamiliar-instruction"})


@dataclass(frozen=True, eq=False)
class TrialRunner:
    """Runs trials. Call it from several threads: the LLM then answers one trial while another is simulated.

    Attributes:
        asking: limits how many threads ask the LLM at once.
    """

    client: RoboPromptClient
    executor: Executor
    world: World = WORLD
    asking: threading.Semaphore = field(default_factory=threading.Semaphore)

    def run(self, planned: PlannedTrial, lesson: Lesson) -> Trial:
        """Run a trial of a method that was taught `lesson`.

        Raises:
            ServiceProblemError, ServiceUnreachableError, LanguageModelError, or a worker's error: the trial does not
                count.
        """
        scene = call(self.executor, self.world.view, planned.task, planned.seed)
        return SOURCES[planned.method.source](self, planned, lesson, Trial(*planned.key, scene))

    def ask_service(self, planned: PlannedTrial, lesson: Lesson, trial: Trial) -> Trial:
        """Ask the service, carry out its answer, and report the outcome."""
        seen = self._observation(planned.method, trial.scene)
        with self.asking:
            started = time.perf_counter()
            try:
                predicted = self.client.predict(lesson.name, trial.scene.instruction, seen, **planned.method.options)
            except ServiceProblemError as error:
                return self._without_actions(replace(trial, predict_s=time.perf_counter() - started), planned, error)
            trial = replace(trial, answer=predicted.response, predict_s=time.perf_counter() - started)
        trial = self._execute(trial, predicted.actions)
        self.client.record_outcome(predicted.id, trial.succeeded, trial.failure or None)
        return trial

    def _observation(self, method: Method, scene: SceneView) -> Observation:
        """Return what the robot sends of the scene: poses with the method's noise, or images only."""
        if method.poses == "vision":
            photographed = call(self.executor, self.world.view, scene.task, scene.seed, True)
            return images_only(photographed.frames, photographed.objects)
        return Observation(disturbed(scene.objects, method.noise, scene.seed))

    def _without_actions(self, trial: Trial, planned: PlannedTrial, error: ServiceProblemError) -> Trial:
        """Return the failed trial of a useless reply, a refused instruction or an object that was not seen.

        Raises:
            ServiceProblemError: any other error, which says nothing about the method.
        """
        problem = error.problem.get("type")
        unseen = planned.method.poses == "vision" and problem in UNSEEN
        if problem not in USELESS_REPLY | REFUSED and not unseen:
            raise error
        answer = self._stored_answer(error.problem["prediction_id"]) if problem in USELESS_REPLY else None
        return replace(trial, answer=answer, error=str(error), refused=problem in REFUSED)

    def _stored_answer(self, prediction_id: str) -> dict[str, Any]:
        """Return the stored record of a prediction without actions, in the form of an answer."""
        stored = self.client.get(f"/predictions/{prediction_id}")
        timings = stored["timings_ms"]
        outside_llm_ms = sum(ms for name, ms in timings.items() if name != "llm")
        return {**stored, "actions": [], "timings_ms": {**timings, "outside_llm": outside_llm_ms}}

    def let_robot_loop(self, planned: PlannedTrial, lesson: Lesson, trial: Trial) -> Trial:
        """Run the robot's own loop in a worker: it asks once, and may look again while it moves."""
        with self.asking:
            return call(
                self.executor, run_loop, self.client.url, lesson.name, planned.seed, planned.method, trial.scene
            )

    def replay_own_keyframes(self, planned: PlannedTrial, lesson: Lesson, trial: Trial) -> Trial:
        """Carry out a demonstration's keyframes in its own scene: an upper bound for any prediction."""
        taught = lesson.taught[planned.seed % len(lesson.taught)]
        keyframes = self.client.get(f"/episodes/{taught.episode_id}")["keyframes"]
        trajectory = taught.recorded.trajectory
        # A keyframe stores the gripper's state: it may lie shortly before or after the recorded switch.
        actions = tuple(replace(trajectory.action_at(k["index"]), gripper_open=k["gripper_open"]) for k in keyframes)
        return self._execute(replace(trial, scene=taught.recorded.scene), actions)

    def replay_expert(self, planned: PlannedTrial, lesson: Lesson, trial: Trial) -> Trial:
        """Carry out the expert's own keyframes in bins: an upper bound for methods that predict bins."""
        return self._execute(trial, call(self.executor, binned_keyframes, planned.task, planned.seed))

    def let_expert_solve(self, planned: PlannedTrial, lesson: Lesson, trial: Trial) -> Trial:
        """Let the expert solve the scene: how often could the task be demonstrated at all?"""
        solved, seconds = call(self.executor, timed, self.world.solve, planned.task, planned.seed)
        execution = RolloutResult(len(solved.expert_actions), solved.succeeded, solved.failure)
        return replace(trial, execution=execution, execute_s=seconds, actions=solved.expert_actions)

    def _execute(self, trial: Trial, actions: Actions) -> Trial:
        execution, seconds = call(self.executor, timed, self.world.execute, trial.scene, actions)
        return replace(trial, actions=tuple(actions), execution=execution, execute_s=seconds)


SOURCES: Mapping[Source, Callable[[TrialRunner, PlannedTrial, Lesson, Trial], Trial]] = {
    "service": TrialRunner.ask_service,
    "robot loop": TrialRunner.let_robot_loop,
    "own keyframes": TrialRunner.replay_own_keyframes,
    "expert replay": TrialRunner.replay_expert,
    "expert": TrialRunner.let_expert_solve,
}
