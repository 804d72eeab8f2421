"""The results as a table and as one JSON object."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median
from typing import Any

from benchmarks.metaworld.ledger import REPLAY, Ledger, Taught, Trial
from benchmarks.metaworld.trials import is_llm

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


def markdown(found: Sequence[TaskResult], facts: Mapping[str, str]) -> str:
    """A page.

    Args:
        facts: how it was made, by what they are about.
    """
    taken = seconds([each for task in found for each in task.llm_seconds])
    llm = (
        f"A prediction of the LLM took {taken['median']:.1f} s (median), at most {taken['max']:.1f} s." if taken else ""
    )
    errors = "\n".join(_kinds(problem for task in found for problem in task.problems))
    parts = [
        table(found),
        llm,
        f"Errors, which count as failures:\n\n{errors}" if errors else "",
        "\n".join(f"- {name}: {value}" for name, value in facts.items()),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def table(found: Sequence[TaskResult]) -> str:
    """Successes of trials, in Markdown, with columns of even width."""
    methods = list(found[0].trials)
    head = ["task", "demonstrations", "keyframes", *methods, "LLM, median s"]
    rows = [head, *(list(_cells(task)) for task in found)]
    means = mean_success_rates(found).values()
    rows.append(["mean", "", "", *(NOTHING if rate is None else f"{rate:.1%}" for rate in means), ""])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])])
    return "\n".join(_line(row, widths) for row in rows)


def _kinds(problems: Iterable[str]) -> Iterator[str]:
    """A line for each status and title, the most frequent first, with one of the details as an example."""
    examples: dict[str, str] = {}
    numbers: Counter[str] = Counter()
    for problem in problems:
        kind, _, detail = problem.partition("; ")
        numbers[kind] += 1
        examples.setdefault(kind, detail)
    for kind, number in numbers.most_common():
        yield f"- {number} x {kind}" + (f", for example: {examples[kind]}" if examples[kind] else "")


def _cells(task: TaskResult) -> Iterator[str]:
    yield task.task
    refused = len(task.taught.refused) if task.taught else 0
    yield f"{task.num_demonstrations}, {refused} refused" if refused else str(task.num_demonstrations)
    span = task.num_keyframes
    yield NOTHING if span is None else "-".join(map(str, sorted(set(span))))
    for method in task.trials:
        yield str(task.score(method))
    taken = seconds(task.llm_seconds)
    yield NOTHING if taken is None else f"{taken['median']:.1f}"


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = zip(row, widths, strict=True)
    cells = [first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]
    return f"| {' | '.join(cells)} |"
