import pytest

from benchmarks.metaworld.ledger import Ledger, LedgerError, Taught, Trial

CONDITIONS = {"demos": 10, "noise_m": 0.0, "settings": None, "models": ("a", "b")}
TAUGHT = Taught("push", "metaworld push 1", {"e1": 0, "e2": 2}, [4, 5])
TRIALS = [Trial("push", "nearest", 1001, True, 0.1, 60), Trial("push", "nearest", 1000, False, problem="422 no")]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "new" / "results.jsonl"


@pytest.fixture
def written(path):
    with Ledger(path, CONDITIONS) as ledger:
        for result in (TAUGHT, *TRIALS):
            ledger.add(result)
    return path


def test_results_come_back(written):
    with Ledger(written, CONDITIONS) as ledger:
        assert ledger.taught("push") == TAUGHT
        assert ledger.trials("push", "nearest") == sorted(TRIALS, key=lambda trial: trial.seed)
        assert ledger.taught("reach") is None
        assert ledger.trials("push", "regression") == ledger.trials("reach", "nearest") == []


def test_the_last_result_counts(written):
    with Ledger(written, CONDITIONS) as ledger:
        ledger.add(Trial("push", "nearest", 1000, True))
        ledger.add(Taught("push", "metaworld push 2", {}, []))
    with Ledger(written, CONDITIONS) as ledger:
        assert [trial.success for trial in ledger.trials("push", "nearest")] == [True, True]
        assert ledger.taught("push").service_task == "metaworld push 2"


def test_a_line_that_a_killed_run_left_unfinished_is_dropped(written):
    whole = written.read_text()
    written.write_text(whole + '{"kind": "trial", "ta')
    with Ledger(written, CONDITIONS) as ledger:
        assert len(ledger.trials("push", "nearest")) == 2
        ledger.add(Trial("push", "nearest", 1002, True))
    with Ledger(written, CONDITIONS) as ledger:
        assert len(ledger.trials("push", "nearest")) == 3


def test_other_conditions_are_refused_by_name(written):
    before = written.read_text()
    other = {**CONDITIONS, "noise_m": 0.01, "record_hz": 10}
    with pytest.raises(LedgerError, match=r"results.jsonl has .* \(noise_m, record_hz\)"):
        Ledger(written, other)
    assert written.read_text() == before


@pytest.mark.parametrize(
    "text",
    [
        '{"a": 1}\n',
        "no JSON\n",
        "[]\n",
        '{"kind": "trial", "task": "push"}\n',
        '{"kind": "conditions"}\n{"kind": "x"}\n',
    ],
)
def test_another_file_is_refused_and_kept(path, text):
    path.parent.mkdir()
    path.write_text(text)
    with pytest.raises(LedgerError, match="is no file of this benchmark"):
        Ledger(path, CONDITIONS)
    assert path.read_text() == text
