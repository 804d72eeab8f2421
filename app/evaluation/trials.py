"""One scene under one method: predict over HTTP, execute in the simulation, tell the service the outcome."""

import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace

from app.client.client import RoboPromptClient
from app.client.errors import ServiceProblemError
from app.client.robot import Observation
from app.evaluation.records import Method, Trial
from app.pipeline.episode import EndEffectorAction
from app.pipeline.keyframes import merged
from app.pipeline.workspace import Workspace, discretize_action, undiscretize_action
from app.sim.demonstrate import RolloutResult, SceneView, record_demonstration, rollout, view_scene

MAX_WAITING = 4  # executions under way while the LLM answers further scenes


@dataclass(frozen=True, eq=False)
class _Timed:
    result: RolloutResult
    seconds: float


def run_trials(
    client: RoboPromptClient,
    executor: Executor,
    task: str,
    seeds: Iterable[int],
    methods: Iterable[Method],
    on_done: Callable[[Trial], None],
) -> tuple[Trial, ...]:
    """Every method on every scene. While one prediction is executed the LLM already answers the next.

    Args:
        on_done: called with each trial as it ends, in order.
    """
    done: list[Trial] = []
    waiting: list[tuple[Trial, Future[_Timed] | None]] = []

    def collect(at_most: int) -> None:
        while len(waiting) > at_most:
            trial, execution = waiting.pop(0)
            done.append(_finish(client, trial, execution))
            on_done(done[-1])

    for scene in _scenes(executor, task, seeds):
        for method in methods:
            waiting.append(_start(client, executor, scene, method))
            collect(MAX_WAITING)
    collect(0)
    return tuple(done)


def _scenes(executor: Executor, task: str, seeds: Iterable[int]) -> Iterator[SceneView]:
    """The scenes of the seeds, each rendered while the one before is worked on."""
    ahead: list[Future[SceneView]] = []
    for seed in seeds:
        ahead.append(executor.submit(view_scene, task, seed))
        if len(ahead) > 1:
            yield ahead.pop(0).result()
    for future in ahead:
        yield future.result()


def _start(
    client: RoboPromptClient, executor: Executor, scene: SceneView, method: Method
) -> tuple[Trial, Future[_Timed] | None]:
    trial = Trial(scene.task, scene.seed, method.label, scene)
    if method.options is None:
        return trial, executor.submit(_replay_expert, scene.task, scene.seed)
    started = time.perf_counter()
    try:
        predicted = client.predict(scene.task, scene.instruction, Observation(scene.objects), **method.options)
    except ServiceProblemError as error:
        return replace(trial, error=_explain(error), predict_s=time.perf_counter() - started), None
    trial = replace(trial, answer=predicted.response, predict_s=time.perf_counter() - started)
    return trial, executor.submit(_execute, scene.task, scene.seed, predicted.actions)


def _finish(client: RoboPromptClient, trial: Trial, execution: Future[_Timed] | None) -> Trial:
    if execution is None:
        return trial
    timed = execution.result()
    trial = replace(trial, execution=timed.result, execute_s=timed.seconds)
    if trial.answer is not None:
        client.record_outcome(trial.answer["id"], trial.succeeded, trial.failure or None)
    return trial


def _execute(task: str, seed: int, actions: tuple[EndEffectorAction, ...]) -> _Timed:
    started = time.perf_counter()
    result = rollout(task, seed, actions, film_strip=True)
    return _Timed(result, time.perf_counter() - started)


def _replay_expert(task: str, seed: int) -> _Timed:
    """The ceiling of any method that predicts the expert's keyframes in bins: these keyframes themselves."""
    recorded = record_demonstration(task, seed, images=False)
    workspace = Workspace.rlbench()
    keyframes = [recorded.trajectory.action_at(index) for index in merged(recorded.trajectory)]
    binned = tuple(undiscretize_action(discretize_action(action, workspace).bins, workspace) for action in keyframes)
    return _execute(task, seed, binned)


def _explain(error: ServiceProblemError) -> str:
    reply = error.problem.get("reply_text")
    return str(error) + ("" if reply is None else f"; the reply was {reply!r}")
