"""What the trials of a task under a method come to."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from app.evaluation.records import Evaluation, Method, TaskEvaluation
from app.evaluation.scores import of_method, task_score
from app.pipeline.success_rate import SuccessRate

_Answer = Mapping[str, Any]


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
        llm_s=_median(answers, lambda answer: answer["timings_ms"]["llm"] / 1000),
        outside_llm_s=_median(answers, lambda answer: answer["timings_ms"]["outside_llm"] / 1000),
        prompt_tokens=_median(answers, lambda answer: answer["usage"]["prompt_tokens"]),
        cached_tokens=_median(answers, lambda answer: answer["usage"]["cached_tokens"]),
        completion_tokens=_median(answers, lambda answer: answer["usage"]["completion_tokens"]),
        not_run=score.not_run,
    )


def _asked(answer: _Answer) -> str:
    return f"{answer['model']}, {answer['representation']}, format {answer['prompt_format']}"


def _median(answers: Sequence[_Answer], value: Callable[[_Answer], float]) -> float | None:
    return median(map(value, answers)) if answers else None
