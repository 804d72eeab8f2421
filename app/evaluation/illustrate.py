"""Chooses the trials that a report shows in detail, and simulates them again with pictures.

Pictures take longer than the simulation, so they are not taken in the first place.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, zip_longest

from rich.progress import Progress

from app.evaluation.methods import Method
from app.evaluation.panda import film
from app.evaluation.results import Evaluation, TaskEvaluation, Trial
from app.executors import Executor
from app.sim.outcomes import RolloutResult, SceneView

MAX_FAILURES = 12  # a task
MAX_SUCCESSES = 2  # a task


def failures_in_order(trials: Sequence[Trial], methods: Sequence[Method]) -> list[Trial]:
    """Return the failed trials, by method and then in the order in which they ran."""
    return list(chain.from_iterable(_by_method(trials, methods, succeeded=False)))


def detailed_failures(trials: Sequence[Trial], methods: Sequence[Method]) -> list[Trial]:
    """Return at most 12 failed trials, alternating methods; of yardsticks only if there is no other method."""
    chosen = _in_turns(_by_method(trials, _models(methods), succeeded=False))[:MAX_FAILURES]
    return [trial for trial in failures_in_order(trials, methods) if trial in chosen]


def detailed_successes(trials: Sequence[Trial], methods: Sequence[Method]) -> list[Trial]:
    """Return at most two solved trials, of different methods if possible; of yardsticks only if there is no other."""
    in_turns = _in_turns(_by_method(trials, _models(methods), succeeded=True))
    return sorted(in_turns, key=lambda trial: trial.answer is None)[:MAX_SUCCESSES]


def _models(methods: Sequence[Method]) -> Sequence[Method]:
    return [method for method in methods if not method.is_yardstick] or methods


def _by_method(trials: Sequence[Trial], methods: Sequence[Method], *, succeeded: bool) -> list[list[Trial]]:
    return [
        [trial for trial in trials if trial.method == method.label and trial.succeeded == succeeded]
        for method in methods
    ]


def _in_turns(groups: Sequence[Sequence[Trial]]) -> list[Trial]:
    return [trial for turn in zip_longest(*groups) for trial in turn if trial is not None]


_Pictures = tuple[SceneView, RolloutResult | None]


def illustrated(evaluation: Evaluation, executor: Executor, progress: Progress) -> Iterator[TaskEvaluation]:
    """Yield the evaluation's tasks with pictures of the detailed trials, one by one: a task's take some 100 MB."""
    methods = evaluation.methods
    shown = [
        [*detailed_failures(task.trials, methods), *detailed_successes(task.trials, methods)]
        for task in evaluation.tasks
    ]
    bar = progress.add_task("pictures", total=sum(map(len, shown)))
    for task, chosen in zip(evaluation.tasks, shown, strict=True):
        pictures = {
            trial: executor.submit(film, trial.scene, trial.actions if trial.execution else None, trial.shift_m)
            for trial in chosen
        }
        for future in pictures.values():
            future.add_done_callback(lambda _: progress.advance(bar))
        trials = (_illustrate(trial, pictures[trial].result()) if trial in pictures else trial for trial in task.trials)
        yield replace(task, trials=tuple(trials))


def _illustrate(trial: Trial, pictures: _Pictures) -> Trial:
    """Return the trial with pictures. It keeps its outcome; a note says if the pictures show another one."""
    execution, (scene, again) = trial.execution, pictures
    if execution is not None and again is not None:
        note = (
            "" if again.succeeded == execution.succeeded else " (simulated again for these pictures: another outcome)"
        )
        execution = replace(execution, film_strip=again.film_strip, failure=execution.failure + note)
    return replace(trial, scene=scene, execution=execution)
