"""Rates of success, and by simulation what holds of pairs at every moment; Ville allows 5 % of wrong runs."""

import numpy as np
import pytest

from app.pipeline.success_rate import DECIDED, Pairs, SuccessRate, winnings

RUNS, TRIALS = 400, 250


def counts(rate_one, rate_other, seed):
    """(RUNS, TRIALS) of pairs in which the one alone succeeded, the other alone, neither alone; after every pair."""
    random = np.random.default_rng(seed)
    one, other = (random.random((RUNS, TRIALS)) < rate for rate in (rate_one, rate_other))
    alone, other_alone = (np.cumsum(item, axis=1) for item in (one & ~other, other & ~one))
    return alone, other_alone, np.arange(1, TRIALS + 1) - alone - other_alone


@pytest.mark.parametrize(("rate_one", "rate_other"), [(0.5, 0.5), (0.9, 0.9), (0.05, 0.05), (0.9, 0.6), (0.2, 0.7)])
def test_the_true_difference_is_seldom_refuted_however_often_one_looks(rate_one, rate_other):
    refuted = winnings(*counts(rate_one, rate_other, seed=7), rate_one - rate_other) >= DECIDED
    assert refuted.any(axis=1).mean() <= 0.05


@pytest.mark.parametrize(("rate_one", "rate_other", "pairs"), [(0.9, 0.5, 60), (1.0, 0.33, 25), (0.4, 0.9, 60)])
def test_a_clear_difference_is_decided_soon(rate_one, rate_other, pairs):
    decided = winnings(*counts(rate_one, rate_other, seed=8), 0.0)[:, :pairs] >= DECIDED
    assert decided.any(axis=1).mean() >= 0.8


def test_the_interval_holds_the_difference_and_agrees_with_the_decision():
    alone, other_alone, alike = counts(0.8, 0.5, seed=9)
    for run in range(40):
        pairs = [Pairs(*map(int, (alone[run, n], other_alone[run, n], alike[run, n]))) for n in (4, 30, TRIALS - 1)]
        for item in pairs:
            low, high = item.interval
            assert -1 <= low <= (item.one_alone - item.other_alone) / item.number <= high <= 1
            assert not (item.is_decided and low < -0.01 and high > 0.01)
    assert pairs[0].interval[1] - pairs[0].interval[0] > pairs[-1].interval[1] - pairs[-1].interval[0]


def test_what_is_foreseen_comes_true_if_it_goes_on_so():
    so_far = Pairs(6, 2, 2)
    assert not so_far.is_decided
    more = so_far.num_until_decided
    share = (so_far.number + more) / so_far.number
    grown = [count * share for count in (6, 2, 2)]
    assert winnings(*grown, 0.0) >= DECIDED > winnings(*[count * (share - 0.1) for count in (6, 2, 2)], 0.0)
    assert Pairs(20, 0, 10).num_until_decided == 0


@pytest.mark.parametrize("pairs", [Pairs(5, 5, 5), Pairs(0, 0, 500), Pairs(0, 0, 0)])
def test_equal_series_are_never_decided(pairs):
    assert not pairs.is_decided
    assert pairs.num_until_decided is None


def test_series_are_paired_in_their_order():
    assert Pairs.of([True, True, False, True], [False, True, True]) == Pairs(1, 1, 1)
    assert Pairs.of([], [True]) == Pairs(0, 0, 0)
    assert Pairs(0, 0, 0).interval == (-1.0, 1.0)
    low, high = Pairs(5000, 0, 0).interval
    assert 0.9 < low <= high == 1.0


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # Wilson (1927) at z = 1.96: (p + z^2/2n -+ z sqrt(p(1-p)/n + z^2/4n^2)) / (1 + z^2/n)
    [(0, 0, 0.0, 1.0), (0, 25, 0.0, 0.1332), (25, 25, 0.8668, 1.0), (20, 25, 0.6087, 0.9114), (5, 10, 0.2366, 0.7634)],
)
def test_wilson_interval(successes, trials, low, high):
    assert SuccessRate(successes, trials).interval == pytest.approx((low, high), abs=1e-4)
