"""Successes, rates and times, as numbers and as one JSON object."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median
from typing import Any

from benchmarks.metaworld.ledger import REPLAY, Ledger, Taught, Trial
from benchmarks.metaworld.plan import is_llm

NOTHING = "-"


@dataclass(frozen=True)
class Score:
    """Of one method on one task; an error is a failure, too.

    Attributes:
        errors: of the trials, those in which nothing was executed.
    """

    successes: int
    trials: int
    errors: int

    @classmethod
    def of(cls, trials: Sequence[Trial]) -> "Score":
        """Count."""
        return cls(sum(t.success for t in trials), len(trials), sum(t.problem is not None for t in trials))

    @property
    def success_rate(self) -> float | None:
        """None without a trial."""
        return self.successes / self.trials if self.trials else None

    def __str__(self) -> str:
        if not self.trials:
            return NOTHING
        errors = f", {self.errors} error{'s' * (self.errors > 1)}" if self.errors else ""
        return f"{self.successes}/{self.trials}{errors}"

    def document(self) -> dict[str, Any]:
        """For programs."""
        return {**vars(self), "success_rate": self.success_rate}


@dataclass(frozen=True)
class TaskResult:
    """Everything about one task.

    Attributes:
        taught: None if the task was not run.
        trials: by method.
    """

    task: str
    taught: Taught | None
    trials: Mapping[str, Sequence[Trial]]

    def score(self, method: str) -> Score:
        """Of a method."""
        return Score.of(self.trials[method])

    @property
    def num_demonstrations(self) -> int:
        """That the service has."""
        return len(self.taught.seeds) if self.taught else 0

    @property
    def num_keyframes(self) -> tuple[int, int] | None:
        """The fewest and the most of a demonstration."""
        found = self.taught.keyframes if self.taught else []
        return (min(found), max(found)) if found else None

    @property
    def llm_seconds(self) -> list[float]:
        """Of every prediction by an LLM."""
        return [trial.seconds for method, trials in self.trials.items() if is_llm(method) for trial in trials]

    @property
    def problems(self) -> list[str]:
        """What the service said where it refused."""
        uploads = self.taught.refused if self.taught else []
        return [*uploads, *(t.problem for trials in self.trials.values() for t in trials if t.problem is not None)]

    def document(self) -> dict[str, Any]:
        """For programs."""
        span = self.num_keyframes
        return {
            "demonstrations": self.num_demonstrations,
            "keyframes": None if span is None else {"min": span[0], "max": span[1]},
            "replay": self.score(REPLAY).document(),
            "models": {method: self.score(method).document() for method in self.trials if method != REPLAY},
            "llm_seconds": seconds(self.llm_seconds),
            "problems": self.problems,
        }


def results(ledger: Ledger, tasks: Sequence[str], models: Sequence[str]) -> list[TaskResult]:
    """What the ledger has of these tasks and models."""
    methods = (REPLAY, *models)
    return [TaskResult(task, ledger.taught(task), {m: ledger.trials(task, m) for m in methods}) for task in tasks]


def seconds(taken: Sequence[float]) -> dict[str, float] | None:
    """Median and longest; None of nothing."""
    return {"median": round(median(taken), 3), "max": round(max(taken), 3)} if taken else None


def mean_success_rates(found: Sequence[TaskResult]) -> dict[str, float | None]:
    """By method, the mean over the tasks in which it was tried; None if that is none."""
    means: dict[str, float | None] = {}
    for method in found[0].trials:
        rates = [rate for task in found if (rate := task.score(method).success_rate) is not None]
        means[method] = mean(rates) if rates else None
    return means


def summary(found: Sequence[TaskResult]) -> dict[str, Any]:
    """For programs."""
    return {
        "tasks": {task.task: task.document() for task in found},
        "mean_success_rate": mean_success_rates(found),
        "errors": sum(task.score(method).errors for task in found for method in task.trials),
        "refused_uploads": sum(len(task.taught.refused) for task in found if task.taught),
        "llm_seconds": seconds([each for task in found for each in task.llm_seconds]),
    }
