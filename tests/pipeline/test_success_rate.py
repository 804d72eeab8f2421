import pytest

from app.pipeline.success_rate import SuccessRate


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # scipy.stats.binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    [(0, 0, 0.0, 1.0), (0, 25, 0.0, 0.1332), (25, 25, 0.8668, 1.0), (20, 25, 0.6087, 0.9114), (5, 10, 0.2366, 0.7634)],
)
def test_wilson_interval(successes, trials, low, high):
    assert SuccessRate(successes, trials).interval == pytest.approx((low, high), abs=1e-4)
