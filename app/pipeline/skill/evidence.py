"""Evidence of residuals: a normal distribution of unknown mean and variance, in closed form.

Murphy, "Conjugate Bayesian analysis of the Gaussian distribution" (2007), section 3: with a normal-inverse-gamma prior
the evidence and the predictive (a Student t) have closed forms. Here the mean is uniform over a width, the limit of a
vague prior that still has a density, and the variance is inverse gamma around a floor of noise. Single demonstrations
may be elsewhere: each costs the price of a uniform density, so that one wrong recording moves no mean.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln, stdtr

from roboprompt_client.types.arrays import Array

SHAPE = 1.0  # of the inverse gamma prior of a variance: worth two demonstrations
ELSEWHERE = 0.05  # prior probability that a demonstration is elsewhere: of the adversary's recordings by people
MAX_ELSEWHERE = 0.34  # share of the demonstrations that may be: more are another way


@dataclass(frozen=True, eq=False)
class Posterior:
    """What residuals (..., N) leave to be known of their distribution: all arrays are (...), but `kept` is (..., N).

    Attributes:
        log_evidence: of all N residuals, in nats.
        mean: of the kept ones.
        shape, rate: of the inverse gamma distribution of the variance.
        number: how many are kept.
        kept: which demonstrations are not elsewhere.
    """

    log_evidence: Array
    mean: Array
    shape: Array
    rate: Array
    number: Array
    kept: npt.NDArray[np.bool_]

    @property
    def dof(self) -> Array:
        """(...) of the predictive Student t."""
        return 2 * self.shape

    def scale(self, *, of_mean: bool = False) -> Array:
        """Return the scale of the Student t of a further demonstration, or of the mean alone."""
        spread = 1 / self.number if of_mean else 1 + 1 / self.number
        found: Array = np.sqrt(self.rate / self.shape * spread)
        return found

    def at(self, index: tuple[object, ...]) -> "Posterior":
        """Return the posterior of some of the residuals, indexed as an array."""
        names = ("log_evidence", "mean", "shape", "rate", "number", "kept")
        return Posterior(*(getattr(self, name)[index] for name in names))


def posterior(residuals: Array, floor: float, width: float) -> Posterior:
    """Return the posterior of residuals (..., N).

    Args:
        floor: standard deviation of the noise that is expected before anything is seen.
        width: over which the mean, and a demonstration that is elsewhere, are uniform.
    """
    kept = np.ones(residuals.shape, dtype=bool)
    total, mean, squares, number = _of(residuals, kept, floor, width)
    for _ in range(int(MAX_ELSEWHERE * residuals.shape[-1])):
        gain = _gain_without(residuals, kept, (mean, squares, number), floor, width)
        worst = gain.argmax(axis=-1)[..., None]
        drops = np.take_along_axis(gain, worst, -1) > 0
        if not drops.any():
            break
        kept &= ~((np.arange(residuals.shape[-1]) == worst) & drops)
        total, mean, squares, number = _of(residuals, kept, floor, width)
    return Posterior(total, mean, SHAPE + (number - 1) / 2, SHAPE * floor**2 + squares / 2, number, kept)


def two_sided_p(residual: npt.ArrayLike, scale: npt.ArrayLike, dof: npt.ArrayLike) -> Array:
    """Return how often chance alone is as far off: of a Student t."""
    found: Array = 2 * stdtr(dof, -np.abs(residual) / scale)
    return found


def log_marginal(squares: Array, number: Array, floor: float, width: float) -> Array:
    """Return the log evidence of `number` values with this sum of squares about their mean (Murphy's equation 102)."""
    shape, rate = SHAPE + (number - 1) / 2, SHAPE * floor**2 + squares / 2
    found: Array = (
        -(number - 1) / 2 * np.log(2 * np.pi) - np.log(number) / 2 - np.log(width)
        + SHAPE * np.log(SHAPE * floor**2) - shape * np.log(rate) + gammaln(shape) - gammaln(SHAPE)
    )  # fmt: skip
    return found


def log_about_zero(squares: Array, number: int, floor: float) -> Array:
    """Return the log evidence of `number` values with this sum of squares about a mean that is known to be zero."""
    shape, rate = SHAPE + number / 2, SHAPE * floor**2 + squares / 2
    found: Array = (
        -number / 2 * np.log(2 * np.pi) + SHAPE * np.log(SHAPE * floor**2)
        - shape * np.log(rate) + gammaln(shape) - gammaln(SHAPE)
    )  # fmt: skip
    return found


def _of(residuals: Array, kept: npt.NDArray[np.bool_], floor: float, width: float) -> tuple[Array, Array, Array, Array]:
    """Return evidence, mean, sum of squares and number of the kept residuals."""
    number: Array = kept.sum(axis=-1).astype(float)
    mean = (residuals * kept).sum(axis=-1) / number
    squares = (kept * (residuals - mean[..., None]) ** 2).sum(axis=-1)
    gone = residuals.shape[-1] - number
    total = log_marginal(squares, number, floor, width)
    return total + gone * np.log(ELSEWHERE / width) + number * np.log(1 - ELSEWHERE), mean, squares, number


def _gain_without(
    residuals: Array, kept: npt.NDArray[np.bool_], known: tuple[Array, Array, Array], floor: float, width: float
) -> Array:
    """Return what the evidence (..., N) gains where each kept residual is elsewhere."""
    mean, squares, number = known
    off = residuals - mean[..., None]
    without = squares[..., None] - (number / np.maximum(number - 1, 1))[..., None] * off**2
    fewer = log_marginal(np.maximum(without, 0), np.maximum(number - 1, 1)[..., None], floor, width)
    gain = fewer + np.log(ELSEWHERE / width) - log_marginal(squares, number, floor, width)[..., None]
    return np.where(kept, gain - np.log(1 - ELSEWHERE), -np.inf)
