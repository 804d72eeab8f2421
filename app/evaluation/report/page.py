"""An evaluation -> a folder with `index.html` and its images; numbers are written as people read them."""

import re
from collections.abc import Iterable
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from app.evaluation.illustrate import detailed_failures, detailed_successes, failures_in_order
from app.evaluation.methods import Method
from app.evaluation.report.charts import success_chart
from app.evaluation.report.pictures import Picture, PictureFolder
from app.evaluation.report.views import PageView, TaskView, TrialView, demonstration_view, trial_view
from app.evaluation.results import Evaluation, TaskEvaluation, Trial
from app.evaluation.scores import Result, results_of

NOTHING = "\N{EN DASH}"


def duration_text(seconds: float | None) -> str:
    """For example ``6.3 ms``, ``1.24 s``, ``2 min 5 s``; a dash for None."""
    if seconds is None:
        return NOTHING
    if seconds < 1:
        return f"{1000 * seconds:.3g} ms"
    if seconds < 100:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s"


def tokens_text(tokens: float | None) -> str:
    """A whole number with thousands set apart; a dash for None."""
    return NOTHING if tokens is None else f"{tokens:,.0f}"


def percent_text(share: float) -> str:
    """A share in [0, 1] as whole percent, without the sign."""
    return f"{100 * share:.0f}"


def write_report(evaluation: Evaluation, folder: Path, illustrated: Iterable[TaskEvaluation] | None = None) -> Path:
    """Write the report into `folder`, over an earlier one; returns the path of its `index.html`.

    At most 12 failures and 2 successes of each task are shown with pictures; the other failures are listed.

    Args:
        illustrated: the evaluation's tasks with their pictures; consumed one by one. None: they have them.
    """
    pictures = PictureFolder(folder)
    results = results_of(evaluation)
    tasks = [
        _task_view(pictures, number, task, evaluation.methods, results)
        for number, task in enumerate(illustrated or evaluation.tasks, start=1)
    ]
    models = any(not method.is_yardstick for method in evaluation.methods)
    yardsticks = frozenset(method.label for method in evaluation.methods if models and method.is_yardstick)
    page = PageView(evaluation.command, evaluation.duration_s, _chart(pictures, results), tuple(tasks), yardsticks)
    index = folder / "index.html"
    index.write_text(_environment().get_template("index.html").render(page=page), encoding="utf-8")
    return index


def _environment() -> Environment:
    """Templates that escape everything: instructions, replies and errors are data."""
    loader = PackageLoader("app.evaluation.report")
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(duration=duration_text, tokens=tokens_text, percent=percent_text)
    return environment


def _chart(pictures: PictureFolder, results: list[Result]) -> Picture:
    alt = "Success rates: " + "; ".join(f"{result.task}, {result.method}: {result.score.rate}" for result in results)
    return pictures.chart("success", lambda theme: success_chart(results, theme), alt)


def _task_view(
    pictures: PictureFolder, number: int, task: TaskEvaluation, methods: tuple[Method, ...], results: list[Result]
) -> TaskView:
    anchor = f"{number}-{re.sub('[^A-Za-z0-9]+', '-', task.task)}"

    def in_detail(kind: str, trials: list[Trial]) -> tuple[TrialView, ...]:
        return tuple(trial_view(pictures, f"{anchor}-{kind}-{k:02}", trial) for k, trial in enumerate(trials, start=1))

    return TaskView(
        task.task,
        anchor,
        tuple(result for result in results if result.task == task.task),
        num_demonstrations=len(task.taught),
        demonstration=demonstration_view(pictures, f"{anchor}-demonstration", task.taught[0]) if task.taught else None,
        failures=in_detail("failure", detailed_failures(task.trials, methods)),
        successes=in_detail("success", detailed_successes(task.trials, methods)),
        failed=tuple(failures_in_order(task.trials, methods)),
        num_trials=len(task.trials),
    )
