"""Success rates with confidence intervals, and a sequential test of whether two rates differ.

The test may be read after every trial, and trials may stop as soon as it decides. Trials are paired, the k-th of one
series with the k-th of the other. If the rates differ by `d`, certain bets on each pair are fair; a bettor whose
capital grows to 20 times the stake refutes `d` with 95 % confidence, at any time (Ville's inequality). The stake is
spread evenly over constant bets in both directions. Source: Waudby-Smith and Ramdas, "Estimating means of bounded
random variables by betting", JRSS B 86 (2024), for the difference of each pair, as robot policies are compared in
arXiv 2503.10966.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from roboprompt_client.types.arrays import Array

CONFIDENCE = 0.95
DECIDED = 1 / (1 - CONFIDENCE)
MAX_FORESEEN = 10_000  # pairs; what needs more is not worth a robot's time
MAX_LOG = 300.0  # of winnings: more than any decision asks for, and a float holds it
_BETS = np.concatenate([-(np.arange(20) + 0.5) / 20, (np.arange(20) + 0.5) / 20])  # shares of the greatest fair bet
_DIFFERENCES = np.linspace(-0.995, 0.995, 200)
_STEP = 0.01


@dataclass(frozen=True)
class SuccessRate:
    """Successes among trials."""

    successes: int
    trials: int

    @property
    def rate(self) -> float:
        """The share of successes, in [0, 1]; 0 without trials."""
        return self.successes / self.trials if self.trials else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the true rate; (0, 1) without trials."""
        if not self.trials:
            return 0.0, 1.0
        from scipy.stats import binomtest  # half a second, which only those who ask shall wait

        bounds = binomtest(self.successes, self.trials).proportion_ci(CONFIDENCE, method="wilson")
        return float(bounds.low), float(bounds.high)

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.successes}/{self.trials} ({100 * low:.0f}-{100 * high:.0f} %)"


@dataclass(frozen=True)
class Pairs:
    """Counts of pairs of trials: only the first succeeded, only the second, or both or neither."""

    one_alone: int
    other_alone: int
    alike: int

    @classmethod
    def of(cls, one: Sequence[bool], other: Sequence[bool]) -> "Pairs":
        """The pairs of two series of trials in their order; the rest of the longer series is left out."""
        both = list(zip(one, other, strict=False))
        alone, other_alone = both.count((True, False)), both.count((False, True))
        return cls(alone, other_alone, len(both) - alone - other_alone)

    @property
    def number(self) -> int:
        """The number of pairs."""
        return self.one_alone + self.other_alone + self.alike

    @property
    def evidence(self) -> float:
        """The capital to which a stake of 1 against equal rates has grown."""
        return float(winnings(self.one_alone, self.other_alone, self.alike, 0.0))

    @property
    def is_decided(self) -> bool:
        """Whether the rates differ, with 95 % confidence."""
        return self.evidence >= DECIDED

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % confidence interval of the first rate minus the second, valid at all times at once."""
        if not self.number:
            return -1.0, 1.0
        kept = _DIFFERENCES[winnings(self.one_alone, self.other_alone, self.alike, _DIFFERENCES) < DECIDED]
        around = [*kept, (self.one_alone - self.other_alone) / self.number]
        return max(-1.0, float(min(around)) - _STEP / 2), min(1.0, float(max(around)) + _STEP / 2)

    @property
    def num_until_decided(self) -> int | None:
        """The estimated number of further pairs until a decision, at the present rates; None if over 10,000."""
        if not self.number:
            return None
        times = np.arange(self.number, MAX_FORESEEN + 1) / self.number
        enough = winnings(times * self.one_alone, times * self.other_alone, times * self.alike, 0.0) >= DECIDED
        return int(enough.argmax()) if enough.any() else None


def winnings(
    one_alone: npt.ArrayLike, other_alone: npt.ArrayLike, alike: npt.ArrayLike, difference: npt.ArrayLike
) -> Array:
    """The capital (...) to which a stake of 1 against a difference of rates in (-1, 1) grows; arguments broadcast."""
    wins, losses, ties, held = (
        np.asarray(item, np.float64)[..., None] for item in (one_alone, other_alone, alike, difference)
    )
    bets = _BETS / np.where(_BETS > 0, 1 + held, 1 - held)
    grown = wins * np.log1p(bets * (1 - held)) + ties * np.log1p(-bets * held) + losses * np.log1p(-bets * (1 + held))
    mean: Array = np.exp(np.minimum(grown, MAX_LOG)).mean(axis=-1)
    return mean
