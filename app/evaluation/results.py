"""The results of an evaluation: trials by task, and the scores of methods over them."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from statistics import fmean, median
from typing import Any, TypeVar

from app.evaluation.methods import Method
from app.pipeline.success_rate import SuccessRate
from app.sim.outcomes import RolloutResult, SceneView
from roboprompt_client.types.poses import EndEffectorAction

NOTHING = "\N{EN DASH}"
TOKENS = ("prompt_tokens", "cached_tokens", "completion_tokens")
ENDINGS = ("wrong_motion", "no_actions", "refused")


@dataclass(frozen=True, eq=False)
class Trial:
    """One scene under one method.

    Attributes:
        scene: the objects at their true poses.
        answer: the service's answer (`POST /predict`), without actions if the LLM's reply had none; None if the
            service was not asked.
        error: why the LLM's reply gave no actions; empty otherwise.
        execution: None where nothing was executed.
        predict_s: from the request to the answer, as the robot sees it.
        execute_s: of simulation.
        actions: what was to be executed.
        shift_m: how far the free objects were moved after the scene had been seen.
        refused: whether the service refused the instruction, before any LLM was asked.
    """

    task: str
    seed: int
    method: str
    scene: SceneView
    answer: Mapping[str, Any] | None = None
    error: str = ""
    execution: RolloutResult | None = None
    predict_s: float = 0.0
    execute_s: float = 0.0
    actions: tuple[EndEffectorAction, ...] = ()
    shift_m: float = 0.0
    refused: bool = False

    @property
    def succeeded(self) -> bool:
        """Whether the scene was solved."""
        return self.execution is not None and self.execution.succeeded

    @property
    def failure(self) -> str:
        """Why it was not; empty if it was."""
        return self.error or ("" if self.execution is None else self.execution.failure)


@dataclass(frozen=True)
class Crash:
    """A trial that could not be run: it says nothing about the method, and counts nowhere."""

    task: str
    seed: int
    method: str
    message: str


@dataclass(frozen=True, eq=False)
class TaskEvaluation:
    """The trials of one task."""

    task: str
    trials: tuple[Trial, ...]
    crashes: tuple[Crash, ...] = ()


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The trials of all tasks.

    Attributes:
        methods: in the order of the tables; the first is what the run is about.
        command: the command line that repeats it.
    """

    command: str
    methods: tuple[Method, ...]
    tasks: tuple[TaskEvaluation, ...]

    @property
    def trials(self) -> list[Trial]:
        """The trials of all tasks."""
        return [trial for task in self.tasks for trial in task.trials]

    @property
    def crashes(self) -> list[Crash]:
        """The crashes of all tasks."""
        return [crash for task in self.tasks for crash in task.crashes]

    def errors(self) -> list[tuple[str, int]]:
        """Return the messages of trials that could not be run, with their numbers, the most frequent first."""
        return Counter(crash.message.strip().splitlines()[-1] for crash in self.crashes).most_common()


Outcome = TypeVar("Outcome", Trial, Crash)


@dataclass(frozen=True)
class MethodResult:
    """A method's results on one task, or on all. Times and tokens are medians of a prediction; None without any.

    Attributes:
        rate: over the trials that ran.
        errors: trials that could not be run.
        endings: by ENDINGS, the number of failed trials: the motion solved nothing, the reply had no actions, or the
            instruction was refused.
        asked: model, representation and prompt format, as the answers name them.
        outside_llm_s: the service's time for a prediction without that of the LLM.
        tokens: by TOKENS.
    """

    method: str
    rate: SuccessRate
    errors: int
    endings: Mapping[str, int]
    asked: tuple[str, ...] = ()
    llm_s: float | None = None
    outside_llm_s: float | None = None
    execute_s: float | None = None
    tokens: Mapping[str, float | None] = field(default_factory=lambda: dict.fromkeys(TOKENS))

    def __str__(self) -> str:
        shown = str(self.rate) if self.rate.trials else NOTHING
        refused = f"{self.endings['refused']} refused" if self.endings["refused"] else ""
        errors = f"{self.errors} error{'s' if self.errors > 1 else ''}" if self.errors else ""
        return ", ".join(filter(None, [shown, refused, errors]))

    def document(self) -> dict[str, Any]:
        """Return the figures as a JSON document."""
        rate = self.rate
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
            "errors": self.errors,
        }


def result_of(evaluated: TaskEvaluation | Evaluation, method: Method) -> MethodResult:
    """Return a method's score on one task, or on all tasks together."""
    trials, crashes = of_method(evaluated.trials, method), of_method(evaluated.crashes, method)
    refused = sum(trial.refused for trial in trials)
    no_actions = sum(trial.execution is None for trial in trials) - refused
    failed = sum(not trial.succeeded for trial in trials)
    answers = [trial.answer for trial in trials if trial.answer is not None]

    def of_answers(value: Callable[[Mapping[str, Any]], float]) -> float | None:
        return _median(map(value, answers))

    return MethodResult(
        method.label,
        SuccessRate(len(trials) - failed, len(trials)),
        len(crashes),
        dict(zip(ENDINGS, (failed - refused - no_actions, no_actions, refused), strict=True)),
        tuple(dict.fromkeys(f"{a['model']}, {a['representation']}, {a['prompt_format']}" for a in answers)),
        llm_s=of_answers(lambda answer: answer["timings_ms"]["llm"] / 1000),
        outside_llm_s=of_answers(lambda answer: answer["timings_ms"]["outside_llm"] / 1000),
        execute_s=_median(trial.execute_s for trial in trials if trial.execution is not None),
        tokens={name: _median(answer["usage"][name] for answer in answers) for name in TOKENS},
    )


def mean_rate(evaluation: Evaluation, method: Method) -> float | None:
    """Return the mean of the tasks' success rates; None without trials."""
    rates = [result_of(task, method).rate for task in evaluation.tasks]
    return fmean(rate.rate for rate in rates if rate.trials) if any(rate.trials for rate in rates) else None


def of_method(outcomes: Iterable[Outcome], method: Method) -> list[Outcome]:
    """Return the outcomes of the method."""
    return [outcome for outcome in outcomes if outcome.method == method.label]


def _median(values: Iterable[float]) -> float | None:
    known = list(values)
    return median(known) if known else None


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
