from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from app.evaluation.costs import Price, Purse, Usage, prices_of, tokens_of, used_by
from app.evaluation.failures import BudgetSpentError
from app.evaluation.methods import Method
from app.evaluation.trials import PlannedTrial
from roboprompt_client.errors import InvalidInputError
from tests.evaluation.trials import ANSWER, trial

MODEL = ANSWER["model"]
PRICES = {MODEL: Price(10_000, 20_000)}  # 100 tokens read and 20 written: 1.4
COST = 1.4
METHOD = Method("default", {"model": MODEL})


def cell(seed):
    return PlannedTrial("push_button", seed, METHOD)


def answered(seed, **changes):
    return replace(trial("push_button", seed, "default", True, ANSWER), **changes)


def purse(budget, expected=COST):
    made = Purse(budget, PRICES, lambda _: None)
    made.expect({(task, METHOD.label): Usage(cost=expected) for task in ("push_button", "open_drawer")})
    return made


@pytest.mark.parametrize(
    ("text", "tokens"),
    [("", 0), ("12", 1), ("1234", 2), ("[[12, 345]]", 6), ("push the red button", 4), ("maroon_button", 3)],
)
def test_tokens(text, tokens):
    assert tokens_of(text) == tokens


def test_prices_of_one_and_several_models():
    assert prices_of(["a", "b"], [1], [2]) == {"a": Price(1, 2), "b": Price(1, 2)}
    assert prices_of(["a", "b"], [1, 3], [2]) == {"a": Price(1, 2), "b": Price(3, 2)}
    assert prices_of(["a"], [], []) == {}
    assert Price(10, 30).of(1_000_000, 100_000) == pytest.approx(13)


@pytest.mark.parametrize(
    ("read", "written", "field"),
    [([1], [], "price-in"), ([], [1], "price-in"), ([1, 2, 3], [1], "price-in"), ([1], [float("nan")], "price-out")],
)
def test_prices_that_are_none(read, written, field):
    with pytest.raises(InvalidInputError) as refused:
        prices_of(["a", "b"], read, written)
    assert refused.value.field == field


def test_what_a_trial_used():
    assert used_by(answered(0), PRICES) == Usage(0, 100, 20, pytest.approx(COST))
    assert used_by(answered(0), {}).cost is None
    assert used_by(trial("push_button", 0, "default", True), PRICES) == Usage()


def spend(from_purse, seeds, trial_of=answered):
    paid = []
    for seed in seeds:
        from_purse.put_aside(cell(seed))
        from_purse.pay(cell(seed), trial_of(seed))
        paid.append(seed)
    return paid


def test_it_stops_before_the_trial_that_would_exceed_it():
    just_three = purse(3 * COST)
    assert spend(just_three, range(3)) == [0, 1, 2]
    with pytest.raises(BudgetSpentError, match=r"may cost 1\.4; of the budget of 4\.2, 4\.2 is spent"):
        just_three.put_aside(cell(3))
    assert just_three.spent == pytest.approx(3 * COST)


def test_an_estimate_too_low_is_corrected_by_the_first_answer():
    short = purse(2 * COST - 0.1, expected=0.01)
    assert spend(short, [0]) == [0]
    with pytest.raises(BudgetSpentError):
        short.put_aside(PlannedTrial("open_drawer", 1, METHOD))


def test_without_a_budget_nothing_is_refused():
    assert spend(purse(None), range(50)) == list(range(50))


@pytest.mark.parametrize(
    "of", [lambda _: None, lambda seed: answered(seed, answer=None), lambda seed: answered(seed, error="useless")]
)
def test_what_nobody_counted_costs_what_was_expected(of):
    dear = purse(100, expected=3.0)
    spend(dear, [0], of)
    assert dear.spent == 3.0


def test_many_threads_do_not_exceed_it():
    shared = purse(10 * COST + 0.5)

    def work(seed):
        try:
            spend(shared, [seed])
        except BudgetSpentError:
            return 0
        return 1

    with ThreadPoolExecutor(8) as pool:
        assert sum(pool.map(work, range(40))) == 10
    assert shared.spent == pytest.approx(10 * COST)


def test_who_does_not_fit_yet_waits_for_what_comes_back():
    """Two trials are expected to cost 3 each, and cost 1.4: both fit into 5, one after the other."""
    tight = purse(5, expected=3.0)
    tight.put_aside(cell(0))
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(tight.put_aside, cell(1))
        tight.pay(cell(0), answered(0))
        waiting.result(5)
    tight.pay(cell(1), answered(1))
    assert tight.spent == pytest.approx(2 * COST)
