"""Results of two tasks, and a third that was not run."""

import pytest

from benchmarks.metaworld.ledger import REPLAY, Ledger, Taught, Trial
from benchmarks.metaworld.scores import results

LLM = "embedded/gemma"
MODELS = ("nearest", LLM)


def trials(task, method, outcomes, **others):
    """A trial for each letter: y done, n not, e an error."""
    for k, outcome in enumerate(outcomes):
        problem = f"422 too far; by {k} m" if outcome == "e" else None
        yield Trial(task, method, 1000 + k, outcome == "y", problem=problem, **others)


@pytest.fixture
def found(tmp_path):
    with Ledger(tmp_path / "results.jsonl", {}) as ledger:
        ledger.add(Taught("push", "push 1", {"a": 0, "b": 1, "c": 3}, [4, 7, 5]))
        ledger.add(Taught("reach-wall", "reach 1", {"d": 0}, [3], refused=["422 no", "422 no"]))
        for task, method, outcomes, seconds in (
            ("push", REPLAY, "yyy", 0.0),
            ("push", "nearest", "yyne", 0.1),
            ("push", LLM, "yn", 3.0),
            ("reach-wall", REPLAY, "y", 0.0),
            ("reach-wall", "nearest", "ee", 0.1),
            ("reach-wall", LLM, "y", 8.0),
        ):
            for trial in trials(task, method, outcomes, seconds=seconds):
                ledger.add(trial)
        return results(ledger, ("push", "reach-wall", "hammer"), MODELS)
