"""What the trials of a method come to, per task and over all tasks, for people and for programs."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import Any, TypeVar

from rich.box import SIMPLE_HEAD
from rich.table import Table

from app.evaluation.results import Crash, Evaluation, Method, TaskEvaluation, Trial
from app.pipeline.success_rate import SuccessRate

Outcome = TypeVar("Outcome", Trial, Crash)
NOTHING = "\N{EN DASH}"
_Answer = Mapping[str, Any]


@dataclass(frozen=True)
class Score:
    """What became of a method's trials.

    Attributes:
        rate: over the trials that ran.
        errors: trials that could not be run.
        timeouts: trials that could not be run because an answer took too long; they are no `errors`.
        refused: trials, among those that ran, whose instruction the service refused.
    """

    rate: SuccessRate
    errors: int = 0
    timeouts: int = 0
    refused: int = 0

    @property
    def not_run(self) -> str:
        """Timeouts and errors in words; empty without any."""
        counts = ((self.timeouts, "timeout"), (self.errors, "error"))
        return ", ".join(f"{number} {noun}{'s' if number > 1 else ''}" for number, noun in counts if number)

    def __str__(self) -> str:
        shown = str(self.rate) if self.rate.trials else NOTHING
        refused = f"{self.refused} refused" if self.refused else ""
        return ", ".join(filter(None, [shown, refused, self.not_run]))


def task_score(task: TaskEvaluation, method: Method) -> Score:
    """A method's score on one task."""
    return _score(of_method(task.trials, method), of_method(task.crashes, method))


def pooled_score(evaluation: Evaluation, method: Method) -> Score:
    """A method's score, all tasks' trials taken together."""
    crashes = [crash for task in evaluation.tasks for crash in of_method(task.crashes, method)]
    return _score(trials_of(evaluation, method), crashes)


def mean_rate(evaluation: Evaluation, method: Method) -> float | None:
    """The mean of the tasks' rates of success; None without trials."""
    rates = [task_score(task, method).rate for task in evaluation.tasks]
    return fmean(rate.rate for rate in rates if rate.trials) if any(rate.trials for rate in rates) else None


def trials_of(evaluation: Evaluation, method: Method) -> list[Trial]:
    """A method's trials on all tasks."""
    return [trial for task in evaluation.tasks for trial in of_method(task.trials, method)]


def errors_of(evaluation: Evaluation) -> list[tuple[str, int]]:
    """What kept trials from being run, the most frequent first, with its number of trials."""
    messages = (crash.message.strip().splitlines()[-1] for task in evaluation.tasks for crash in task.crashes)
    return Counter(messages).most_common()


def of_method(outcomes: Iterable[Outcome], method: Method) -> list[Outcome]:
    """Those of the method."""
    return [outcome for outcome in outcomes if outcome.method == method.label]


def _score(trials: Sequence[Trial], crashes: Sequence[Crash]) -> Score:
    timeouts = sum(crash.timed_out for crash in crashes)
    rate = SuccessRate(sum(trial.succeeded for trial in trials), len(trials))
    return Score(rate, len(crashes) - timeouts, timeouts, sum(trial.refused for trial in trials))


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
        **endings(trials),
        "llm_s": _median([item["llm"] / 1000 for item in timings]),
        "outside_llm_ms": _median([item["outside_llm"] for item in timings]),
        "execute_s": _median([trial.execute_s for trial in trials if trial.execution is not None]),
        "tokens": {name: _median([item[name] for item in usages]) for name in tokens},
    }


def endings(trials: Sequence[Trial]) -> dict[str, int]:
    """How trials failed: the instruction was refused, the reply gave no actions, or the actions did not solve it."""
    refused = sum(trial.refused for trial in trials)
    no_actions = sum(trial.execution is None for trial in trials) - refused
    failed = sum(not trial.succeeded for trial in trials)
    return {"wrong_motion": failed - refused - no_actions, "no_actions": no_actions, "refused": refused}


def _median(values: Sequence[float]) -> float | None:
    return round(median(values), 3) if values else None


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) and value < 100 else f"{value:.0f}"


@dataclass(frozen=True)
class Result:
    """One row of the table. Medians are over the trials that the service answered; None where it answered none.

    Attributes:
        asked: model, representation and prompt format, as the answers name them.
        outside_llm_s: the service's time for a prediction less that of the LLM.
        not_run: timeouts and errors in words, which are no failures.
    """

    task: str
    method: str
    rate: SuccessRate
    asked: tuple[str, ...]
    llm_s: float | None
    outside_llm_s: float | None
    prompt_tokens: float | None
    cached_tokens: float | None
    completion_tokens: float | None
    not_run: str = ""


def results_of(evaluation: Evaluation) -> list[Result]:
    """A result for each task and method, in their order."""
    return [_result(task, method) for task in evaluation.tasks for method in evaluation.methods]


def _result(task: TaskEvaluation, method: Method) -> Result:
    trials, score = of_method(task.trials, method), task_score(task, method)
    answers = [trial.answer for trial in trials if trial.answer is not None]
    return Result(
        task.task,
        method.label,
        score.rate,
        tuple(dict.fromkeys(map(_asked, answers))),
        llm_s=_median_of(answers, lambda answer: answer["timings_ms"]["llm"] / 1000),
        outside_llm_s=_median_of(answers, lambda answer: answer["timings_ms"]["outside_llm"] / 1000),
        prompt_tokens=_median_of(answers, lambda answer: answer["usage"]["prompt_tokens"]),
        cached_tokens=_median_of(answers, lambda answer: answer["usage"]["cached_tokens"]),
        completion_tokens=_median_of(answers, lambda answer: answer["usage"]["completion_tokens"]),
        not_run=score.not_run,
    )


def _asked(answer: _Answer) -> str:
    return f"{answer['model']}, {answer['representation']}, format {answer['prompt_format']}"


def _median_of(answers: Sequence[_Answer], value: Callable[[_Answer], float]) -> float | None:
    return median(map(value, answers)) if answers else None
