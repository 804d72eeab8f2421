"""Results for people and for programs."""

from collections.abc import Sequence
from statistics import median
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from app.evaluation.records import Evaluation, Trial
from app.evaluation.scores import of_method, task_score
from app.pipeline.success_rate import SuccessRate


def results_table(evaluation: Evaluation) -> Table:
    """One row per task and method."""
    table = Table(
        title="success on unseen scenes (95 % interval), medians a prediction",
        caption="tokens: prompt/cached/completion",
        box=SIMPLE_HEAD,
    )
    for column in ("task, method", "success", "LLM s", "other ms", "run s", "tokens"):
        table.add_column(column, justify="left" if column == "task, method" else "right", overflow="fold")
    for task in evaluation.tasks:
        table.add_row(task.task)
        for method in evaluation.methods:
            numbers = method_summary(of_method(task.trials, method))
            shown = [numbers["llm_s"], numbers["outside_llm_ms"], numbers["execute_s"]]
            tokens = "/".join(_number(value) for value in numbers["tokens"].values()).strip("/")
            score = str(task_score(task, method))
            table.add_row(f"  {method.label}", score, *(_number(value) for value in shown), tokens)
        table.add_section()
    return table


def summary(evaluation: Evaluation) -> dict[str, Any]:
    """The same for programs: the first method's figures per task, the others beside them."""
    tasks = {}
    for task in evaluation.tasks:
        by_method = {
            method.label: method_summary([trial for trial in task.trials if trial.method == method.label])
            for method in evaluation.methods
        }
        first = evaluation.methods[0].label
        tasks[task.task] = {"demonstrations": len(task.taught), **by_method.pop(first), "compared_with": by_method}
    crashes = [crash for task in evaluation.tasks for crash in task.crashes]
    timeouts = sum(crash.timed_out for crash in crashes)
    duration_s = round(evaluation.duration_s, 1)
    return {
        "command": evaluation.command,
        "tasks": tasks,
        "errors": len(crashes) - timeouts,
        "timeouts": timeouts,
        "duration_s": duration_s,
    }


def method_summary(trials: Sequence[Trial]) -> dict[str, Any]:
    """Successes, and medians over the trials that have a figure."""
    successes = sum(trial.succeeded for trial in trials)
    timings = [trial.answer["timings_ms"] for trial in trials if trial.answer is not None]
    usages = [trial.answer["usage"] for trial in trials if trial.answer is not None]
    tokens = ("prompt_tokens", "cached_tokens", "completion_tokens")
    return {
        "successes": successes,
        "trials": len(trials),
        "success_rate": SuccessRate(successes, len(trials)).rate,
        "llm_s": _median([item["llm"] / 1000 for item in timings]),
        "outside_llm_ms": _median([item["outside_llm"] for item in timings]),
        "execute_s": _median([trial.execute_s for trial in trials if trial.execution is not None]),
        "tokens": {name: _median([item[name] for item in usages]) for name in tokens},
    }


def _median(values: Sequence[float]) -> float | None:
    return round(median(values), 3) if values else None


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) and value < 100 else f"{value:.0f}"
