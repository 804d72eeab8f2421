import pytest

from app.pipeline.success_rate import SuccessRate


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # Wilson (1927) at z = 1.96: (p + z^2/2n -+ z sqrt(p(1-p)/n + z^2/4n^2)) / (1 + z^2/n)
    [(0, 25, 0.0, 0.1332), (25, 25, 0.8668, 1.0), (20, 25, 0.6087, 0.9114), (5, 10, 0.2366, 0.7634)],
)
def test_wilson_interval(successes, trials, low, high):
    assert SuccessRate(successes, trials).interval == pytest.approx((low, high), abs=1e-4)


def test_nothing_is_known_without_trials():
    assert SuccessRate(0, 0).interval == (0.0, 1.0)
