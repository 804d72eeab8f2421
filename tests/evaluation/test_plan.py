from dataclasses import replace

import pytest

from app.evaluation.panda import Panda
from app.evaluation.plan import Plan
from app.evaluation.sweeps import REGRESSION

PLAN = Plan(("push_button",), (REGRESSION,), 25, 10, "roboprompt eval")


@pytest.mark.parametrize(
    "change",
    [
        {"world": Panda("continuous")},
        {"world": Panda().recorded_at(40)},
        {"settings": {"keyframes": {"rule": "merged"}}},
        {"first_test_seed": 7},
        {"first_test_seed": 200_000},
        {"demonstrations": 5},
    ],
)
def test_what_changes_a_result_changes_the_digest(change):
    assert replace(PLAN, **change).digest(REGRESSION) != PLAN.digest(REGRESSION)


def test_further_scenes_can_be_added_where_they_change_no_demonstration():
    more = {"episodes": 50}
    assert replace(PLAN, **more).digest(REGRESSION) == PLAN.digest(REGRESSION)
    far, near = replace(PLAN, first_test_seed=200_000), replace(PLAN, first_test_seed=7)
    assert replace(far, **more).digest(REGRESSION) == far.digest(REGRESSION)
    assert replace(near, **more).digest(REGRESSION) != near.digest(REGRESSION)


def test_unseen_scenes_begin_at_the_seed():
    shifted = replace(PLAN, first_test_seed=7, episodes=3)
    assert [cell.seed for cell in shifted.trials()] == [7, 8, 9]
    assert PLAN.seeds == range(100_000, 100_025)
