"""The methods that evaluations compare, apart from those that only one sweep knows."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from app.evaluation.records import REPLAY, Method, Poses

PAPER = {"representation": "absolute", "prompt_format": "paper", "system_prompt": "a"}
KAT = {"representation": "action_tokens", "prompt_format": "kat"}
REGRESSION = Method("regression, no LLM", {"model": "regression"})
COPY = Method("nearest demonstration's rows, no LLM", {"model": "nearest"})
NEAREST = Method("nearest demonstration", source="nearest demonstration")


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
    return Method(label, options), paper, REGRESSION, REPLAY


def with_poses(methods: Iterable[Method], poses: Poses) -> tuple[Method, ...]:
    """The methods with the service finding poses as told; those that do not ask it stay as they are.

    Raises:
        InvalidInputError: for a method that needs given poses.
    """
    return tuple(replace(method, poses=poses) if method.asks_service else method for method in methods)


def with_models(methods: Iterable[Method], models: Sequence[str]) -> tuple[Method, ...]:
    """The methods with each of the models in turn; those that name a model or ask nobody stay as they are.

    Args:
        models: none leaves the choice to the service.
    """
    crossed: list[Method] = []
    for method in methods:
        if not method.asks_service or "model" in method.options or not models:
            crossed.append(method)
            continue
        for model in models:
            label = f"{method.label}, {model}" if len(models) > 1 else method.label
            crossed.append(replace(method, label=label, options={**method.options, "model": model}))
    return tuple(crossed)
