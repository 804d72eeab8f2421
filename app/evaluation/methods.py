"""The methods that evaluations compare."""

from typing import Any

from app.evaluation.records import REPLAY, Method

PAPER = {"representation": "absolute", "prompt_format": "paper", "system_prompt": "a"}


def methods_beside(model: str | None, representation: str | None) -> tuple[Method, ...]:
    """The method asked for, and what to hold it against: the paper's format, a regression, the expert's replay.

    Args:
        model: a name from `GET /models`; None: the service's default.
        representation: None: what suits the model.
    """
    wishes: dict[str, Any] = {"model": model, "representation": representation}
    options = {name: value for name, value in wishes.items() if value is not None}
    label = ", ".join([model or "default LLM", representation or "its representation"])
    paper = Method("the same LLM, paper's format", {**options, **PAPER})
    return Method(label, options), paper, Method("regression, no LLM", {"model": "regression"}), REPLAY
