"""Computes the results of a method's trials, per task and over all tasks, and the accuracy of a driver's motions."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import fmean, median
from typing import Any, TypeVar

from app.evaluation.methods import Method
from app.evaluation.results import Crash, Evaluation, TaskEvaluation, Trial
from app.pipeline.success_rate import SuccessRate

Outcome = TypeVar("Outcome", Trial, Crash)
NOTHING = "\N{EN DASH}"
TOKENS = ("prompt_tokens", "cached_tokens", "completion_tokens")
ENDINGS = ("wrong_motion", "no_actions", "refused")


@dataclass(frozen=True)
class Score:
    """The success rate of a method's trials, and the numbers of trials that say nothing about it.

    Attributes:
        rate: over the trials that ran.
        errors: trials that could not be run, without `timeouts`.
        timeouts: trials that could not be run because an answer took too long.
        refused: trials that ran and whose instruction the service refused.
    """

    rate: SuccessRate
    errors: int = 0
    timeouts: int = 0
    refused: int = 0

    @property
    def not_run(self) -> str:
        """Timeouts and errors as text; empty without any."""
        counts = ((self.timeouts, "timeout"), (self.errors, "error"))
        return ", ".join(f"{number} {noun}{'s' if number > 1 else ''}" for number, noun in counts if number)

    def __str__(self) -> str:
        shown = str(self.rate) if self.rate.trials else NOTHING
        refused = f"{self.refused} refused" if self.refused else ""
        return ", ".join(filter(None, [shown, refused, self.not_run]))


@dataclass(frozen=True)
class Result:
    """A method's results on one task, or on all. Times and tokens are medians of a prediction; None without any.

    Attributes:
        task: empty for all tasks.
        asked: model, representation and prompt format, as the answers name them.
        endings: by ENDINGS, the number of failed trials: the motion solved nothing, the reply had no actions, or the
            instruction was refused.
        outside_llm_s: the service's time for a prediction without that of the LLM.
        tokens: by TOKENS.
    """

    task: str
    method: str
    score: Score
    asked: tuple[str, ...] = ()
    endings: Mapping[str, int] = field(default_factory=dict)
    llm_s: float | None = None
    outside_llm_s: float | None = None
    execute_s: float | None = None
    tokens: Mapping[str, float | None] = field(default_factory=lambda: dict.fromkeys(TOKENS))

    def document(self) -> dict[str, Any]:
        """Return the figures as a JSON document."""
        rate = self.score.rate
        return {
            "successes": rate.successes,
            "trials": rate.trials,
            "success_rate": rate.rate,
            **self.endings,
            "llm_s": _rounded(self.llm_s),
            "outside_llm_ms": _rounded(None if self.outside_llm_s is None else 1000 * self.outside_llm_s),
            "execute_s": _rounded(self.execute_s),
            "tokens": {name: _rounded(number) for name, number in self.tokens.items()},
            "interval": rate.interval,
            "errors": self.score.errors,
            "timeouts": self.score.timeouts,
        }


def task_result(task: TaskEvaluation, method: Method) -> Result:
    """Return a method's result on one task."""
    return _result(task.task, method, of_method(task.trials, method), of_method(task.crashes, method))


def pooled_result(evaluation: Evaluation, method: Method) -> Result:
    """Return a method's result over the trials of all tasks."""
    crashes = [crash for task in evaluation.tasks for crash in of_method(task.crashes, method)]
    trials = [trial for task in evaluation.tasks for trial in of_method(task.trials, method)]
    return _result("", method, trials, crashes)


def mean_rate(evaluation: Evaluation, method: Method) -> float | None:
    """Return the mean of the tasks' success rates; None without trials."""
    rates = [task_result(task, method).score.rate for task in evaluation.tasks]
    return fmean(rate.rate for rate in rates if rate.trials) if any(rate.trials for rate in rates) else None


def errors_of(evaluation: Evaluation) -> list[tuple[str, int]]:
    """Return the messages of trials that could not be run, with their numbers, the most frequent first."""
    messages = (crash.message.strip().splitlines()[-1] for task in evaluation.tasks for crash in task.crashes)
    return Counter(messages).most_common()


def of_method(outcomes: Iterable[Outcome], method: Method) -> list[Outcome]:
    """Return the outcomes of the method."""
    return [outcome for outcome in outcomes if outcome.method == method.label]


def _result(task: str, method: Method, trials: Sequence[Trial], crashes: Sequence[Crash]) -> Result:
    timeouts = sum(crash.timed_out for crash in crashes)
    refused = sum(trial.refused for trial in trials)
    no_actions = sum(trial.execution is None for trial in trials) - refused
    failed = sum(not trial.succeeded for trial in trials)
    answers = [trial.answer for trial in trials if trial.answer is not None]

    def of_answers(value: Callable[[Mapping[str, Any]], float]) -> float | None:
        return _median(map(value, answers))

    return Result(
        task,
        method.label,
        Score(SuccessRate(len(trials) - failed, len(trials)), len(crashes) - timeouts, timeouts, refused),
        tuple(dict.fromkeys(f"{a['model']}, {a['representation']}, {a['prompt_format']}" for a in answers)),
        dict(zip(ENDINGS, (failed - refused - no_actions, no_actions, refused), strict=True)),
        llm_s=of_answers(lambda answer: answer["timings_ms"]["llm"] / 1000),
        outside_llm_s=of_answers(lambda answer: answer["timings_ms"]["outside_llm"] / 1000),
        execute_s=_median(trial.execute_s for trial in trials if trial.execution is not None),
        tokens={name: _median(answer["usage"][name] for answer in answers) for name in TOKENS},
    )


def _median(values: Iterable[float]) -> float | None:
    known = list(values)
    return median(known) if known else None


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)


@dataclass(frozen=True)
class Reached:
    """How far a driver's arm was from the commanded poses, over all actions."""

    poses: int
    median_mm: float
    worst_mm: float
    median_deg: float
    worst_deg: float

    def __str__(self) -> str:
        position = f"{self.median_mm:.2g} mm in the median, {self.worst_mm:.2g} mm at worst"
        rotation = f"{self.median_deg:.2g} and {self.worst_deg:.2g} degrees"
        return f"{self.poses} poses reached: off by {position} ({rotation})"


def reached(evaluation: Evaluation) -> Reached | None:
    """Return the accuracy of a driver's motions; None if the simulation moved the arm without a driver."""
    executions = [trial.execution for task in evaluation.tasks for trial in task.trials]
    misses = [miss for execution in executions if execution is not None for miss in execution.misses]
    if not misses:
        return None
    off_mm, off_deg = [1000 * off_m for off_m, _ in misses], [turned_deg for _, turned_deg in misses]
    return Reached(len(misses), median(off_mm), max(off_mm), median(off_deg), max(off_deg))
