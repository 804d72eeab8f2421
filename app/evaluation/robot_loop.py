"""Trials by the robot's own loop, in a scene that changes between the answer and the motion."""

import time
from dataclasses import replace
from typing import Any

from app.evaluation.methods import Method
from app.evaluation.paper import disturbed
from app.evaluation.results import Trial
from app.sim.demonstrate import judge
from app.sim.outcomes import RolloutResult, SceneView
from app.sim.robot import SimulatedPanda
from app.sim.shift import shift_free_objects
from app.sim.tasks import ALL_TASKS, make_task
from roboprompt_client.answers import PredictedActions
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import MotionError, ObjectLostError, ServiceProblemError, UnsafeActionError
from roboprompt_client.robot import Observation
from roboprompt_client.runs.loop import run_task
from roboprompt_client.types.poses import EndEffectorAction

# the problems that are the LLM's failure, not the service's
USELESS_REPLY = frozenset({"/problems/unparsable-reply", "/problems/unsafe-action", "/problems/unsupported"})


class ChangingPanda(SimulatedPanda):
    """A simulated robot in a scene whose objects are moved once it has looked.

    Attributes:
        actions: carried out, and the one that failed.
        num_done: how many were carried out.
    """

    def __init__(self, task: str, seed: int, method: Method) -> None:
        super().__init__(make_task(task, seed, ALL_TASKS[task].test_variation(seed)), cameras=())
        self._seed, self._method = seed, method
        self._has_looked, self._shifted = False, method.shift_m == 0
        self.actions: list[EndEffectorAction] = []
        self.num_done = 0

    def observe(self) -> Observation:
        """Return the objects as they lie, up to the noise of an estimator."""
        if self._has_looked:
            self._shift()
        self._has_looked = True
        seen = super().observe()
        return replace(seen, objects=disturbed(seen.objects, self._method.noise, self._seed))

    def execute(self, action: EndEffectorAction) -> None:
        self._shift()
        self.actions.append(action)
        super().execute(action)
        self.num_done += 1

    def _shift(self) -> None:
        if not self._shifted:
            shift_free_objects(self.task, self._method.shift_m, self._seed)
            self._shifted = True


class _Client(RoboPromptClient):
    """Keeps what it was answered, also where carrying it out fails."""

    predicted: PredictedActions | None = None

    def predict(self, *arguments: Any, **options: Any) -> PredictedActions:  # noqa: ANN401
        self.predicted = super().predict(*arguments, **options)
        return self.predicted


def run_loop(url: str, name: str, seed: int, method: Method, scene: SceneView) -> Trial:
    """Run a trial; for a worker process, which must reach the service.

    Args:
        name: of the task at the service.

    Raises:
        ServiceProblemError, ServiceUnreachableError, InvalidInputError: nothing is known about the method.
    """
    started = time.perf_counter()
    robot = ChangingPanda(scene.task, seed, method)
    with _Client(url) as client:
        error, blocked = _ask_and_move(client, robot, name, method)
        failure = error or blocked or judge(robot)
        if client.predicted is not None:
            client.record_outcome(client.predicted.id, not failure, failure or None)
    answer = None if client.predicted is None else client.predicted.response
    predict_s = 0.0 if answer is None else answer["timings_ms"]["total"] / 1000
    return Trial(
        scene.task,
        seed,
        method.label,
        scene,
        answer=answer,
        error=error,
        execution=None if error else RolloutResult(robot.num_done, not failure, failure),
        predict_s=predict_s,
        execute_s=time.perf_counter() - started - predict_s,
        actions=tuple(robot.actions),
        shift_m=method.shift_m,
    )


def _ask_and_move(client: _Client, robot: ChangingPanda, name: str, method: Method) -> tuple[str, str]:
    """Return why the reply gave no actions, and what ended the motion; empty texts if nothing did."""
    options = {"on_danger": "go", **method.options}
    try:
        run_task(client, robot, name, robot.task.instruction, look_again=method.look_again, **options)
    except (MotionError, ObjectLostError, UnsafeActionError) as failure:
        return "", str(failure)
    except ServiceProblemError as problem:
        if problem.problem.get("type") not in USELESS_REPLY:
            raise
        return str(problem), ""
    return "", ""
