import numpy as np
import pytest
from scipy.integrate import dblquad

from app.pipeline.skill.evidence import (
    ELSEWHERE,
    SHAPE,
    log_about_zero,
    log_marginal,
    posterior,
    two_sided_p,
)

FLOOR, WIDTH = 0.5, 8.0


def density(values, mean, log_variance):
    """The joint density of values, mean and log variance (inverse gamma)."""
    variance = np.exp(log_variance)
    rate = SHAPE * FLOOR**2
    prior = rate**SHAPE * variance ** (-SHAPE - 1) * np.exp(-rate / variance) / WIDTH
    squares = ((values - mean) ** 2).sum()
    return prior * variance * (2 * np.pi * variance) ** (-len(values) / 2) * np.exp(-squares / (2 * variance))


def test_the_closed_form_is_the_integral_over_mean_and_variance():
    values = np.array([0.3, -0.2, 0.4, 0.1])
    integral, _ = dblquad(lambda mean, lv: density(values, mean, lv), -12, 8, -WIDTH / 2, WIDTH / 2, epsabs=1e-10)
    squares = ((values - values.mean()) ** 2).sum()
    assert log_marginal(squares, np.float64(4), FLOOR, WIDTH) == pytest.approx(np.log(integral), abs=0.01)


def test_about_a_known_mean_it_is_the_integral_over_the_variance_alone():
    values = np.array([0.3, -0.2, 0.4, 0.1])
    grid = np.linspace(-12, 8, 4001)
    integral = np.trapezoid([WIDTH * density(values, 0.0, lv) for lv in grid], grid)
    assert log_about_zero((values**2).sum(), 4, FLOOR) == pytest.approx(np.log(integral), abs=1e-4)


def test_one_demonstration_elsewhere_moves_no_mean():
    values = 0.01 * np.array([1.0, -1.0, 0.5, -0.5, 0.2, 30.0])
    found = posterior(values, 0.003, 1.0)
    assert found.kept.tolist() == [True] * 5 + [False]
    assert found.mean == pytest.approx(values[:5].mean())


def test_a_half_elsewhere_is_scatter():
    found = posterior(np.array([0.0, 0.0, 0.0, 0.3, 0.3, 0.3]), 0.003, 1.0)
    assert found.kept.all()
    assert found.scale() > 0.1


def test_what_is_elsewhere_costs_its_prior():
    values = np.array([0.0, 0.0, 0.0, 0.0, 0.4])
    found = posterior(values, 0.003, 1.0)
    rest = log_marginal(np.float64(0), np.float64(4), 0.003, 1.0)
    assert found.log_evidence == pytest.approx(rest + np.log(ELSEWHERE) + 4 * np.log(1 - ELSEWHERE))


def test_more_demonstrations_narrow_the_predictive():
    random = np.random.default_rng(3)
    scales = [posterior(0.001 * random.normal(size=n), 0.003, 1.0).scale() for n in (1, 2, 4, 8, 16)]
    assert sorted(scales, reverse=True) == scales


def test_the_predictive_p_is_that_of_samples():
    samples = np.random.default_rng(5).standard_t(4.0, 200_000)
    assert two_sided_p(2.0, 1.0, 4.0) == pytest.approx((np.abs(samples) > 2).mean(), abs=0.003)
