from benchmarks.metaworld.ledger import REPLAY
from benchmarks.metaworld.scores import Score, mean_success_rates, summary
from tests.benchmarks.metaworld.conftest import LLM, trials


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
