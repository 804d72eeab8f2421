import pytest

from benchmarks.metaworld.ledger import REPLAY, Ledger, Taught, Trial
from benchmarks.metaworld.table import Score, markdown, mean_success_rates, results, summary

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


def rows(text):
    lines = [line[1:-1].split("|") for line in text.splitlines() if line.startswith("|")]
    return {first.strip(): [cell.strip() for cell in cells] for first, *cells in lines}


def test_a_score_counts_errors_as_failures():
    assert Score.of(list(trials("push", "nearest", "yyne"))) == Score(2, 4, 1)
    assert Score(2, 4, 1).success_rate == 0.5
    assert [str(score) for score in (Score(2, 4, 0), Score(2, 4, 1), Score(0, 4, 4), Score(0, 0, 0))] == [
        "2/4",
        "2/4, 1 error",
        "0/4, 4 errors",
        "-",
    ]
    assert Score(0, 0, 0).success_rate is None


def test_means_are_over_the_tasks_that_were_tried(found):
    assert mean_success_rates(found) == {REPLAY: 1.0, "nearest": 0.25, LLM: 0.75}
    assert mean_success_rates(found[2:]) == {REPLAY: None, "nearest": None, LLM: None}


def test_summary(found):
    document = summary(found)
    push = document["tasks"]["push"]
    assert push["replay"] == {"successes": 3, "trials": 3, "errors": 0, "success_rate": 1.0}
    assert push["models"] == {
        "nearest": {"successes": 2, "trials": 4, "errors": 1, "success_rate": 0.5},
        LLM: {"successes": 1, "trials": 2, "errors": 0, "success_rate": 0.5},
    }
    assert (push["demonstrations"], push["keyframes"]) == (3, {"min": 4, "max": 7})
    assert push["problems"] == ["422 too far; by 3 m"]
    assert document["tasks"]["hammer"]["keyframes"] is document["tasks"]["hammer"]["llm_seconds"] is None
    assert document["tasks"]["hammer"]["replay"]["success_rate"] is None
    assert document["llm_seconds"] == {"median": 3.0, "max": 8.0}
    assert (document["errors"], document["refused_uploads"]) == (3, 2)


def test_markdown(found):
    text = markdown(found, {"versions": "metaworld 1"})
    table = rows(text)
    assert table["task"] == ["demonstrations", "keyframes", "replay", "nearest", LLM, "LLM, median s"]
    assert table["push"] == ["3", "4-7", "3/3", "2/4, 1 error", "1/2", "3.0"]
    assert table["reach-wall"] == ["1, 2 refused", "3", "1/1", "0/2, 2 errors", "1/1", "8.0"]
    assert table["hammer"] == ["0", "-", "-", "-", "-", "-"]
    assert table["mean"] == ["", "", "100.0%", "25.0%", "75.0%", ""]
    assert "A prediction of the LLM took 3.0 s (median), at most 8.0 s." in text
    assert "- 3 x 422 too far, for example: by 3 m\n- 2 x 422 no\n" in text
    assert text.endswith("- versions: metaworld 1\n")


def test_markdown_without_llm_and_errors(found):
    text = markdown(found[2:], {})
    assert "Errors" not in text
    assert "LLM took" not in text
    assert len({len(line) for line in text.splitlines() if line}) == 1, "columns are of even width"
