"""Tables of an evaluation with the paper's numbers, as Markdown, for a terminal, and as JSON."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from app.evaluation import paper
from app.evaluation.methods import Method
from app.evaluation.results import (
    ENDINGS,
    NOTHING,
    TOKENS,
    Evaluation,
    MethodResult,
    TaskEvaluation,
    mean_rate,
    result_of,
)

HOW_TO_READ = (
    "Successes/trials on unseen scenes with Wilson's 95 % interval; the mean is over tasks. Errors are trials that"
    " could not be run (a worker crashed, the service or its LLM failed or took too long):"
    " they count neither way. A trial whose instruction the service refuses is no success."
)
METHODS_SAID = (
    "What was asked: model, representation, prompt format, and whatever else was set; then how trials failed: the"
    " motion solved nothing, the reply had no actions, the instruction was refused. Medians a prediction."
)
ENDED = ("wrong motion", "no actions", "instruction refused")
COSTS = ("LLM s", "service ms", "execution s", "tokens read", "cached", "written")
ROBOPROMPT = "RoboPrompt (paper)"
Cells = Sequence[str]


@dataclass(frozen=True)
class TextTable:
    """A table of texts whose rows come in groups. The first column is text, the others are numbers."""

    header: Cells
    groups: Sequence[Sequence[Cells]]

    def markdown(self) -> str:
        """Return the table as Markdown."""
        align = ["---", *["---:"] * (len(self.header) - 1)]
        rows = [self.header, align, *(row for group in self.groups for row in group)]
        return "\n".join(f"| {' | '.join(row)} |" for row in rows)

    def terminal(self, title: str, caption: str | None = None) -> Table:
        """Return the table for a terminal, with a line between the groups."""
        table = Table(title=title, caption=caption, box=SIMPLE_HEAD)
        for number, header in enumerate(self.header):
            table.add_column(header, justify="right" if number else "left", overflow="fold")
        for group in self.groups:
            for row in group:
                table.add_row(*row)
            table.add_section()
        return table


def markdown(evaluation: Evaluation, about: str) -> str:
    """Return the contents of `table.md`, headed by what the sweep compares."""
    success = _success_table(evaluation)
    methods = TextTable(["method", "asked", "all trials", *ENDED, *COSTS], [list(_method_rows(evaluation))])
    parts = [
        f"# {about[0].upper()}{about[1:]}",
        HOW_TO_READ,
        success.markdown(),
        *([paper.SOURCE] if ROBOPROMPT in success.header else []),
        "## Methods",
        METHODS_SAID,
        methods.markdown(),
        *_errors_section(evaluation),
        f"Command: `{evaluation.command}`",
    ]
    return "\n\n".join(parts) + "\n"


def _errors_section(evaluation: Evaluation) -> list[str]:
    errors = [f"- {number} x {message}" for message, number in evaluation.errors()]
    return ["## Errors", "\n".join(errors)] if errors else []


def _success_table(evaluation: Evaluation) -> TextTable:
    """Return success by task, and the mean: of our methods, then of the paper's if it has any of the tasks."""
    names = [task.task for task in evaluation.tasks]
    known = any(task in paper.SUCCESS_PERCENT[name] for task in names for name in paper.METHODS)
    published = paper.METHODS if known else ()
    rows: list[Cells] = []
    for task in evaluation.tasks:
        percents = [paper.SUCCESS_PERCENT[name].get(task.task) for name in published]
        scores = [str(result_of(task, method)) for method in evaluation.methods]
        rows.append([task.task, *scores, *(NOTHING if percent is None else str(percent) for percent in percents)])
    means = [mean_rate(evaluation, method) for method in evaluation.methods]
    paper_means = [paper.mean_percent(name, names) for name in published]
    ours = [NOTHING if mean is None else f"{100 * mean:.1f} %" for mean in means]
    mean_row = ["mean", *ours, *(NOTHING if mean is None else f"{mean:.1f}" for mean in paper_means)]
    header = ["task", *(method.label for method in evaluation.methods), *(f"{name} (paper)" for name in published)]
    return TextTable(header, [rows, [mean_row]])


def results_table(evaluation: Evaluation) -> Table:
    """Return success and medians by task and method, for a terminal."""
    header = ("task, method", "success", "LLM s", "other ms", "run s", "tokens")
    groups = [[[task.task, *[""] * 5], *_result_rows(task, evaluation.methods)] for task in evaluation.tasks]
    title = "success on unseen scenes (95 % interval), medians a prediction"
    return TextTable(header, groups).terminal(title, "tokens: prompt/cached/completion")


def _result_rows(task: TaskEvaluation, methods: Sequence[Method]) -> Iterator[Cells]:
    for method in methods:
        result = result_of(task, method)
        *costs, read, cached, written = (_number(value, "") for value in _costs(result))
        yield [f"  {method.label}", str(result), *costs, f"{read}/{cached}/{written}".strip("/")]
    percent = paper.SUCCESS_PERCENT["RoboPrompt"].get(task.task)
    if percent is not None:
        yield [f"  {ROBOPROMPT}", f"{percent} %", *[""] * 4]


def sweep_summary(evaluation: Evaluation) -> dict[str, Any]:
    """Return figures by task (of the first method, and of each), means, and the paper's means."""
    names = [task.task for task in evaluation.tasks]
    return {
        "tasks": {task.task: _task_summary(task, evaluation.methods) for task in evaluation.tasks},
        "mean_success_rate": {method.label: mean_rate(evaluation, method) for method in evaluation.methods},
        "paper_mean_percent": {name: paper.mean_percent(name, names) for name in paper.METHODS},
        "trials": len(evaluation.trials),
        "errors": len(evaluation.crashes),
    }


def _task_summary(task: TaskEvaluation, methods: Sequence[Method]) -> dict[str, Any]:
    by_method = {method.label: result_of(task, method).document() for method in methods}
    first = methods[0].label
    return {**by_method[first], "method": first, "methods": by_method}


def _method_rows(evaluation: Evaluation) -> Iterator[Cells]:
    for method in evaluation.methods:
        result = result_of(evaluation, method)
        ended = [str(result.endings[name]) for name in ENDINGS]
        costs = [_number(value, NOTHING) for value in _costs(result)]
        yield [method.label, _asked(result, method), str(result), *ended, *costs]


def _costs(result: MethodResult) -> list[float | None]:
    outside_llm_ms = None if result.outside_llm_s is None else 1000 * result.outside_llm_s
    return [result.llm_s, outside_llm_ms, result.execute_s, *(result.tokens[name] for name in TOKENS)]


def _asked(result: MethodResult, method: Method) -> str:
    special = {
        "pose noise": method.noise,
        "objects moved by m": method.shift_m,
        "looks again": method.look_again,
    }
    own = {**method.options, **method.settings, **{name: value for name, value in special.items() if value}}
    further = {name: value for name, value in own.items() if name not in ("model", "representation", "prompt_format")}
    return "; ".join([*result.asked, *(f"{name} {json.dumps(value)}" for name, value in further.items())]) or NOTHING


def _number(value: float | None, nothing: str) -> str:
    return nothing if value is None else f"{value:.3g}" if value < 100 else f"{value:.0f}"
