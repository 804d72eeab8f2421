"""Numbers, dates and problems as people read them."""

from collections.abc import Mapping
from datetime import UTC, datetime
from math import sqrt
from statistics import NormalDist
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


def interval_text(successes: int, failures: int) -> str:
    """Wilson's 95 % interval of the rate of success, in whole percent; a dash without any trial."""
    trials = successes + failures
    if not trials:
        return NOTHING
    z2 = NormalDist().inv_cdf(0.975) ** 2
    centre = (successes + z2 / 2) / (trials + z2)
    half = sqrt(z2 * (successes * failures / trials + z2 / 4)) / (trials + z2)
    low, high = (100 * max(0.0, centre - half), 100 * min(1.0, centre + half))
    return f"{low:.0f}{NOTHING}{high:.0f}\N{NO-BREAK SPACE}%"


FATE_TEXTS = {"failure": "failed", "refused": "no actions", "unknown": "no outcome", "success": "succeeded"}


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
    "fate": FATE_TEXTS.__getitem__,
}
