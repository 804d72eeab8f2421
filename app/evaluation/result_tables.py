"""The tables of a sweep, beside the paper's numbers: as Markdown, on a terminal, and for programs."""

import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from app.evaluation import paper
from app.evaluation.results import Evaluation, Method, TaskEvaluation, Trial
from app.evaluation.scores import (
    NOTHING,
    errors_of,
    mean_rate,
    method_summary,
    of_method,
    pooled_score,
    task_score,
    trials_of,
)

HOW_TO_READ = (
    "Successes/trials on unseen scenes with Wilson's 95 % interval; the mean is over tasks. Errors are trials that"
    " could not be run (a worker crashed, the service or its LLM failed), timeouts those whose answer took too long:"
    " they count neither way. A trial whose instruction the service refuses is no success."
)
UNBOUNDED = 10_000  # columns, to measure how wide a table wants to be
ENDINGS = ("wrong motion", "no actions", "instruction refused")
COSTS = ("LLM s", "service ms", "execution s", "tokens read", "cached", "written")


def markdown(evaluation: Evaluation, about: str) -> str:
    """The contents of `table.md`.

    Args:
        about: what the sweep compares, in one line.
    """
    labels = [method.label for method in evaluation.methods]
    published = [f"{name} (paper)" for name in _published(evaluation)]
    parts = [
        f"# {about[0].upper()}{about[1:]}",
        HOW_TO_READ,
        markdown_table(["task", *labels, *published], success_rows(evaluation)),
        *([paper.SOURCE] if published else []),
        "## Methods",
        "What was asked: model, representation, prompt format, and whatever else was set; then how trials failed: the"
        " motion solved nothing, the reply had no actions, the instruction was refused. Medians a prediction.",
        markdown_table(["method", "asked", "all trials", *ENDINGS, *COSTS], _method_rows(evaluation)),
        *_error_section(evaluation),
        f"Command: `{evaluation.command}`",
    ]
    return "\n\n".join(parts) + "\n"


def terminal_table(evaluation: Evaluation, width: int) -> Table:
    """Our methods beside the paper's RoboPrompt; where `width` columns have no room for that, below each other."""
    table = _wide_table(evaluation)
    unbounded = Console(width=UNBOUNDED)
    fits = unbounded.measure(table).maximum <= width
    return table if fits else _long_table(evaluation)


def _long_table(evaluation: Evaluation) -> Table:
    """A row for each task and method."""
    table = Table(title="success on unseen scenes (95 % interval, %)", box=SIMPLE_HEAD)
    for header in ("task", "method", "success"):
        table.add_column(header, justify="right" if header == "success" else "left", overflow="fold")
    labels = [*(method.label for method in evaluation.methods), "RoboPrompt (paper)"]
    for task, *cells in success_rows(evaluation):
        for index, (label, cell) in enumerate(zip(labels, cells, strict=False)):
            table.add_row("" if index else task, label, cell.replace(" %)", ")"))
        table.add_section()
    return table


def _wide_table(evaluation: Evaluation) -> Table:
    table = Table(title="success on unseen scenes (95 % interval, %)", box=SIMPLE_HEAD)
    headers = ["task", *(method.label for method in evaluation.methods), "RoboPrompt (paper)"]
    for header in headers:
        table.add_column(header, justify="left" if header == "task" else "right")
    *tasks, mean = success_rows(evaluation)
    for row in tasks:
        table.add_row(*(cell.replace(" %)", ")") for cell in row[: len(headers)]))
    table.add_section()
    table.add_row(*mean[: len(headers)])
    return table


def sweep_summary(evaluation: Evaluation) -> dict[str, Any]:
    """Figures by task, of the first method and beside them of each, means, and the paper's."""
    names = [task.task for task in evaluation.tasks]
    return {
        "tasks": {task.task: _task_summary(task, evaluation.methods) for task in evaluation.tasks},
        "mean_success_rate": {method.label: mean_rate(evaluation, method) for method in evaluation.methods},
        "paper_mean_percent": {name: paper.mean_percent(name, names) for name in paper.METHODS},
        "trials": sum(len(task.trials) for task in evaluation.tasks),
        "errors": sum(not crash.timed_out for task in evaluation.tasks for crash in task.crashes),
        "timeouts": sum(crash.timed_out for task in evaluation.tasks for crash in task.crashes),
    }


def success_rows(evaluation: Evaluation) -> Iterator[list[str]]:
    """A row for each task and one for the mean: our methods, then the paper's."""
    for task in evaluation.tasks:
        published = [paper.SUCCESS_PERCENT[name].get(task.task) for name in _published(evaluation)]
        scores = [str(task_score(task, method)) for method in evaluation.methods]
        yield [task.task, *scores, *(NOTHING if percent is None else str(percent) for percent in published)]
    tasks = [task.task for task in evaluation.tasks]
    means = [mean_rate(evaluation, method) for method in evaluation.methods]
    paper_means = [paper.mean_percent(name, tasks) for name in _published(evaluation)]
    ours = [NOTHING if mean is None else f"{100 * mean:.1f} %" for mean in means]
    yield ["mean", *ours, *(NOTHING if mean is None else f"{mean:.1f}" for mean in paper_means)]


def _published(evaluation: Evaluation) -> tuple[str, ...]:
    """The paper's methods, if the paper has any of the tasks."""
    known = any(task.task in paper.SUCCESS_PERCENT[name] for task in evaluation.tasks for name in paper.METHODS)
    return tuple(paper.METHODS) if known else ()


def _error_section(evaluation: Evaluation) -> list[str]:
    errors = [f"- {number} x {message}" for message, number in errors_of(evaluation)]
    return ["## Errors", "\n".join(errors)] if errors else []


def _task_summary(task: TaskEvaluation, methods: Sequence[Method]) -> dict[str, Any]:
    first = methods[0]
    return {
        **_figures(task, first),
        "method": first.label,
        "methods": {method.label: _figures(task, method) for method in methods},
    }


def _figures(task: TaskEvaluation, method: Method) -> dict[str, Any]:
    scored = task_score(task, method)
    figures = method_summary(of_method(task.trials, method))
    return {**figures, "interval": scored.rate.interval, "errors": scored.errors, "timeouts": scored.timeouts}


def _method_rows(evaluation: Evaluation) -> Iterator[list[str]]:
    for method in evaluation.methods:
        trials = trials_of(evaluation, method)
        figures = method_summary(trials)
        ended = [str(figures[name]) for name in ("wrong_motion", "no_actions", "refused")]
        costs = [figures["llm_s"], figures["outside_llm_ms"], figures["execute_s"], *figures["tokens"].values()]
        yield [method.label, _asked(trials, method), str(pooled_score(evaluation, method)), *ended, *map(_cost, costs)]


def _asked(trials: Sequence[Trial], method: Method) -> str:
    answers = [trial.answer for trial in trials if trial.answer is not None]
    asked = dict.fromkeys(f"{a['model']}, {a['representation']}, {a['prompt_format']}" for a in answers)
    shift = {"objects moved by m": method.shift_m} if method.shift_m else {}
    unseen = {"demonstrations of": "similar tasks"} if method.unseen else {}
    own = {**method.options, **method.settings, **_noise_of(method), **shift, **unseen, **_looks(method)}
    further = {name: value for name, value in own.items() if name not in ("model", "representation", "prompt_format")}
    return "; ".join([*asked, *(f"{name} {json.dumps(value)}" for name, value in further.items())]) or NOTHING


def _looks(method: Method) -> dict[str, Any]:
    if not method.look_again:
        return {}
    return {"looks again": True} | ({"leads by s": method.lead_s} if method.lead_s else {})


def _noise_of(method: Method) -> dict[str, Any]:
    if not method.noise:
        return {}
    where = "pose noise" if method.noise_on == "both" else "pose noise of tests alone"
    return {where: method.noise}


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table whose first column is text and whose others are numbers."""
    align = ["---", *["---:"] * (len(header) - 1)]
    return "\n".join(f"| {' | '.join(row)} |" for row in [header, align, *rows])


def _cost(value: float | None) -> str:
    return NOTHING if value is None else f"{value:.3g}" if value < 100 else f"{value:.0f}"
