"""What a number of successes says about the rate of success."""

from dataclasses import dataclass

CONFIDENCE = 0.95


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
