"""Numbers, dates and problems as people read them."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from app.store.records import TaskCounts

NOTHING = "\N{EN DASH}"


def date_text(moment: datetime) -> str:
    """For example ``2026-03-01 14:05 UTC``."""
    return f"{moment.astimezone(UTC):%Y-%m-%d %H:%M} UTC"


def number_text(number: float) -> str:
    """With thousands set apart."""
    return f"{number:,}"


def metres_text(position_m: tuple[float, ...]) -> str:
    """Coordinates to the millimetre."""
    return ", ".join(f"{value:.3f}" for value in position_m)


def share_text(share: float | None) -> str:
    """A share in [0, 1] as whole percent; a dash for None."""
    return NOTHING if share is None else f"{100 * share:.0f}\N{NO-BREAK SPACE}%"


def success_rate(counts: TaskCounts) -> float | None:
    """The share of successes among the predictions whose outcome was recorded; None without any."""
    recorded = counts.successes + counts.failures
    return counts.successes / recorded if recorded else None


def plural(number: int, one: str, many: str = "") -> str:
    """``1 episode``, ``2 episodes``."""
    return f"{number_text(number)} {one if number == 1 else many or one + 's'}"


FILTERS: Mapping[str, Any] = {
    "date": date_text,
    "number": number_text,
    "metres": metres_text,
    "share": share_text,
    "success_rate": success_rate,
    "plural": plural,
}
