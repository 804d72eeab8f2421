"""Tasks that `roboprompt eval --url` taught: a session names its own `TASK.eval-SESSION`; people read it in words."""

import re
from collections.abc import Iterable

_EVALUATED = re.compile(r"(.+)\.eval-([0-9a-f]{6})", re.DOTALL)


def is_evaluated(name: str) -> bool:
    """Whether a session of an evaluation taught the task."""
    return _EVALUATED.fullmatch(name) is not None


def task_text(name: str) -> str:
    """The task's name as pages show it: ``push_button, evaluation fe7416`` for those of evaluations."""
    match = _EVALUATED.fullmatch(name)
    return name if match is None else f"{match[1]}, evaluation {match[2]}"


def by_origin(names: Iterable[str]) -> tuple[list[str], list[str]]:
    """The tasks that people or robots taught, and those of evaluations."""
    taught: list[str] = []
    evaluated: list[str] = []
    for name in names:
        (evaluated if is_evaluated(name) else taught).append(name)
    return taught, evaluated
