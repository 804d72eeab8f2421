"""What the trials of a method come to, per task and over all tasks."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import TypeVar

from app.evaluation.records import Crash, Evaluation, Method, TaskEvaluation, Trial
from app.pipeline.success_rate import SuccessRate

Outcome = TypeVar("Outcome", Trial, Crash)
NOTHING = "\N{EN DASH}"


@dataclass(frozen=True)
class Score:
    """What became of a method's trials.

    Attributes:
        rate: over the trials that ran.
        errors: trials that could not be run.
        timeouts: trials that could not be run because an answer took too long; they are no `errors`.
    """

    rate: SuccessRate
    errors: int = 0
    timeouts: int = 0

    @property
    def not_run(self) -> str:
        """Timeouts and errors in words; empty without any."""
        counts = ((self.timeouts, "timeout"), (self.errors, "error"))
        return ", ".join(f"{number} {noun}{'s' if number > 1 else ''}" for number, noun in counts if number)

    def __str__(self) -> str:
        shown = str(self.rate) if self.rate.trials else NOTHING
        return f"{shown}, {self.not_run}" if self.not_run else shown


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
    return Score(rate, len(crashes) - timeouts, timeouts)
