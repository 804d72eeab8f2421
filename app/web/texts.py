"""How pages write numbers, dates, shares, and the names of tasks.

A session of `roboprompt eval --url` names the tasks that it teaches `TASK.eval-SESSION`; people read that in words.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from markupsafe import Markup

from app.pipeline.success_rate import SuccessRate
from app.store.records import TaskCounts

NOTHING = "\N{EN DASH}"
_PART = re.compile(r"[^/_]+[/_]*|[/_]+")
_EVALUATED = re.compile(r"(.+)\.eval-([0-9a-f]{6})", re.DOTALL)


def date_text(moment: datetime) -> str:
    """For example ``2026-03-01 14:05 UTC``."""
    return f"{moment.astimezone(UTC):%Y-%m-%d %H:%M} UTC"


def number_text(number: float) -> str:
    """With thousands set apart."""
    return f"{number:,}"


def metres_text(position_m: tuple[float, ...]) -> str:
    """Coordinates to the millimetre."""
    return ", ".join(f"{value:z.3f}" for value in position_m)


def rotation_text(quaternion_xyzw: Sequence[float]) -> str:
    """A quaternion for a field: four numbers with blanks between them, to a hundredth of a degree."""
    return " ".join(f"{round(value, 5) + 0.0:g}" for value in quaternion_xyzw)


def breakable_text(name: str) -> Markup:
    """A name of several parts that a narrow column may break between them, and nowhere else."""
    return Markup("<wbr>").join(Markup.escape(part) for part in _PART.findall(name))  # escaped


def share_text(share: float | None) -> str:
    """A share in [0, 1] as whole percent; a dash for None."""
    return NOTHING if share is None else f"{100 * share:.0f}\N{NO-BREAK SPACE}%"


def success_rate(counts: TaskCounts) -> float | None:
    """The share of successes among the predictions whose outcome was recorded; None without any."""
    recorded = counts.successes + counts.failures
    return counts.successes / recorded if recorded else None


def interval_text(successes: int, failures: int) -> str:
    """Wilson's 95 % interval of the rate of success, in whole percent; a dash without any trial."""
    if not (trials := successes + failures):
        return NOTHING
    low, high = SuccessRate(successes, trials).interval
    return f"{100 * low:.0f}{NOTHING}{100 * high:.0f}\N{NO-BREAK SPACE}%"


FATE_TEXTS = {"failure": "failed", "refused": "no actions", "unknown": "no outcome", "success": "succeeded"}


def plural(number: int, one: str, many: str = "") -> str:
    """``1 episode``, ``2 episodes``."""
    return f"{number_text(number)} {one if number == 1 else many or one + 's'}"


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


FILTERS: Mapping[str, Any] = {
    "date": date_text,
    "number": number_text,
    "metres": metres_text,
    "rotation": rotation_text,
    "breakable": breakable_text,
    "share": share_text,
    "success_rate": success_rate,
    "plural": plural,
    "fate": FATE_TEXTS.__getitem__,
    "task": task_text,
    "by_origin": by_origin,
}
