"""Pictures for the trials that a report shows: simulated again, since pictures take longer than the simulation."""

from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace

from rich.progress import Progress

from app.evaluation.executors import Executor
from app.evaluation.records import Evaluation, TaskEvaluation, TaughtEpisode, Trial
from app.evaluation.report.selection import detailed_failures, detailed_successes
from app.pipeline.episode import EndEffectorAction
from app.sim.demonstrate import RolloutResult, SceneView, rollout, view_scene
from app.sim.tasks import TASKS


@dataclass(frozen=True, eq=False)
class _Pictures:
    scene: SceneView
    execution: RolloutResult | None


def illustrated(evaluation: Evaluation, executor: Executor, progress: Progress) -> Iterator[TaskEvaluation]:
    """The evaluation's tasks with pictures of the first demonstration and of the trials that a report shows.

    One after the other: the pictures of one task take some 100 MB.
    """
    shown = [_shown(task, evaluation) for task in evaluation.tasks]
    bar = progress.add_task("pictures", total=sum(map(len, shown)))
    for task, trials in zip(evaluation.tasks, shown, strict=True):
        first = _view_first(executor, task.taught)
        pictures = {trial: _submit(executor, trial) for trial in trials}
        for future in pictures.values():
            future.add_done_callback(lambda _: progress.advance(bar))
        yield _with_pictures(task, first, pictures)


def _shown(task: TaskEvaluation, evaluation: Evaluation) -> list[Trial]:
    methods = evaluation.methods
    return [*detailed_failures(task.trials, methods), *detailed_successes(task.trials, methods)]


def _view_first(executor: Executor, taught: Sequence[TaughtEpisode]) -> Future[SceneView] | None:
    if not taught or taught[0].recorded.scene.frames:
        return None
    scene = taught[0].recorded.scene
    return executor.submit(view_scene, scene.task, scene.seed)


def _submit(executor: Executor, trial: Trial) -> Future[_Pictures]:
    actions = None if trial.execution is None else trial.actions
    return executor.submit(_take_pictures, trial.task, trial.seed, actions, trial.shift_m)


def _take_pictures(
    task: str, seed: int, actions: Sequence[EndEffectorAction] | None, shift_m: float = 0.0
) -> _Pictures:
    """Runs in a worker."""
    variation = TASKS[task].test_variation(seed)
    scene = view_scene(task, seed, variation=variation)
    if actions is None:
        return _Pictures(scene, None)
    return _Pictures(scene, rollout(task, seed, actions, variation=variation, film_strip=True, shift_m=shift_m))


def _with_pictures(
    task: TaskEvaluation, first: Future[SceneView] | None, futures: dict[Trial, Future[_Pictures]]
) -> TaskEvaluation:
    taught = task.taught
    if first is not None:
        seen = replace(taught[0].recorded, scene=first.result())
        taught = (replace(taught[0], recorded=seen), *taught[1:])
    trials = (_illustrate(trial, futures[trial].result()) if trial in futures else trial for trial in task.trials)
    return replace(task, taught=taught, trials=tuple(trials))


def _illustrate(trial: Trial, pictures: _Pictures) -> Trial:
    """The trial with its pictures. The outcome stays that of the trial; where the pictures show another, it says so."""
    execution, again = trial.execution, pictures.execution
    if execution is not None and again is not None:
        note = (
            "" if again.succeeded == execution.succeeded else " (simulated again for these pictures: another outcome)"
        )
        execution = replace(execution, film_strip=again.film_strip, failure=execution.failure + note)
    return replace(trial, scene=pictures.scene, execution=execution)
