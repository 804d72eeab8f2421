"""Success rates with confidence intervals."""

from dataclasses import dataclass
from math import sqrt

Z = 1.959964  # of the normal distribution, for 95 %


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
        """Wilson's 95 % interval of the true rate (JASA 22, 1927); (0, 1) without trials."""
        if not (number := self.trials):
            return 0.0, 1.0
        center = self.rate + Z**2 / (2 * number)
        half = Z * sqrt(self.rate * (1 - self.rate) / number + Z**2 / (4 * number**2))
        share = 1 + Z**2 / number
        return max(0.0, (center - half) / share), min(1.0, (center + half) / share)

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.successes}/{self.trials} ({100 * low:.0f}-{100 * high:.0f} %)"
