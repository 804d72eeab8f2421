import os
from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.ledger import Ledger, LedgerError
from app.evaluation.methods import REGRESSION, Method
from app.evaluation.plan import Plan
from app.evaluation.results import Crash
from app.evaluation.world import Panda
from tests.evaluation.trials import ACTION, ANSWER, OBJECTS, trial

SOLVED = trial("stack_cube", 100_000, "default", succeeded=True, answer=ANSWER)
UNSOLVED = trial("stack_cube", 100_001, "default", succeeded=False)
UNPARSABLE = replace(SOLVED, seed=100_002, execution=None, actions=(), error="502 no list of actions")
CRASH = Crash("stack_cube", 100_003, "default", "BrokenProcessPool: a worker died")


@pytest.fixture
def path(tmp_path):
    with Ledger(tmp_path / "new" / "results.jsonl") as ledger:
        for outcome in (SOLVED, UNSOLVED, UNPARSABLE, CRASH):
            ledger.append(outcome, "d1")
    return tmp_path / "new" / "results.jsonl"


def find(ledger, seed, digest="d1"):
    return ledger.find("stack_cube", seed, "default", digest)


def test_trials_come_back(path):
    with Ledger(path) as ledger:
        solved, unsolved, unparsable = (find(ledger, 100_000 + k) for k in range(3))
        assert find(ledger, 100_003) == CRASH
    assert (solved.succeeded, unsolved.succeeded, unparsable.succeeded) == (True, False, False)
    assert (unsolved.failure, unparsable.failure) == (UNSOLVED.failure, "502 no list of actions")
    assert (solved.answer, unparsable.execution) == (ANSWER, None)
    assert solved.scene.instruction == SOLVED.scene.instruction
    for pose, given in zip(solved.scene.objects, OBJECTS, strict=True):
        np.testing.assert_array_equal(pose.position_m, given.position_m)
    np.testing.assert_array_equal(solved.actions[0].quaternion_xyzw, ACTION.quaternion_xyzw)


def test_what_was_not_run_or_run_otherwise_is_not_found(path):
    with Ledger(path) as ledger:
        assert find(ledger, 100_009) is None
        assert find(ledger, 100_000, "d2") is None


def test_the_last_outcome_counts(path):
    with Ledger(path) as ledger:
        ledger.append(trial("stack_cube", 100_003, "default", succeeded=True), "d1")
        assert find(ledger, 100_003).succeeded
    with Ledger(path) as ledger:
        assert find(ledger, 100_003).succeeded


@pytest.mark.parametrize("kept", [0, 1, 40])
def test_a_line_that_was_not_finished_is_dropped(path, kept):
    whole = path.read_bytes()
    last = whole.splitlines(keepends=True)[-1]
    os.truncate(path, len(whole) - len(last) + kept)
    with Ledger(path) as ledger:
        assert find(ledger, 100_002).error
        assert find(ledger, 100_003) is None
        ledger.append(CRASH, "d1")
    assert path.read_bytes().count(b"\n") == 4
    with Ledger(path) as ledger:
        assert find(ledger, 100_003) == CRASH


@pytest.mark.parametrize("line", [b"nonsense", b"[]", b'{"status": "success"}'])
def test_a_damaged_line_is_named(path, line):
    path.write_bytes(path.read_bytes() + line + b"\n")
    with pytest.raises(LedgerError, match="line 5"):
        Ledger(path)


def test_one_run_at_a_time(path):
    with Ledger(path), pytest.raises(LedgerError, match=r"results\.jsonl"):
        Ledger(path)
    with Ledger(path) as ledger:
        assert find(ledger, 100_000) is not None


PLAN = Plan(("push_button",), (REGRESSION,), 25, 10, "roboprompt eval")


@pytest.mark.parametrize(
    "change",
    [
        {"options": {"model": "x"}},
        {"settings": {"keyframes": {}}},
        {"noise": 1.0},
        {"source": "expert"},
        {"poses": "vision"},
        {"source": "robot loop"},
        {"source": "robot loop", "look_again": True},
    ],
)
def test_the_digest_follows_the_method(change):
    assert PLAN.digest(replace(Method("a"), **change)) != PLAN.digest(Method("a"))
    assert PLAN.digest(Method("a", {"x": 1, "y": 2})) == PLAN.digest(Method("b", {"y": 2, "x": 1}))


@pytest.mark.parametrize(
    "change",
    [
        {"world": Panda("continuous")},
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
