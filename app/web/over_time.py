"""How a configuration's success went from its first predictions to its latest, as a small drawing with intervals."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from app.pipeline.success_rate import SuccessRate

MAX_STRETCHES = 10
LEAST = 3  # predictions in a stretch: of fewer the interval is nearly everything
WIDTH, HEIGHT = 100.0, 28.0  # units of the drawing


@dataclass(frozen=True)
class OverTime:
    """What the template draws.

    Attributes:
        line: the rate of each stretch, as SVG writes points.
        band: around their 95 % intervals, as SVG writes points.
        words: the same for people who do not see it.
    """

    line: str
    band: str
    words: str


def over_time(successes: Sequence[bool]) -> OverTime | None:
    """Success in stretches of equally many predictions, oldest first; None where they are too few for two stretches."""
    number = min(MAX_STRETCHES, len(successes) // LEAST)
    if number < 2:
        return None
    ends = [round(k * len(successes) / number) for k in range(number + 1)]
    rates = [SuccessRate(sum(successes[a:b]), b - a) for a, b in pairwise(ends)]
    line = [_point(k, number, rate.successes / rate.trials) for k, rate in enumerate(rates)]
    low = [_point(k, number, rate.interval[0]) for k, rate in enumerate(rates)]
    high = [_point(k, number, rate.interval[1]) for k, rate in enumerate(rates)]
    words = ", ".join(f"{rate.successes} of {rate.trials}" for rate in rates)
    return OverTime(" ".join(line), " ".join([*low, *reversed(high)]), f"in turn {words}")


def _point(index: int, number: int, share: float) -> str:
    return f"{WIDTH * index / (number - 1):.1f},{HEIGHT * (1 - share):.1f}"
