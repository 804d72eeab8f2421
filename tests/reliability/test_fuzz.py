from tests.reliability.fuzz import fuzz


def test_every_operation_answers_as_documented_and_never_5xx(tmp_path):
    """Some hundred cases; `python -m tests.reliability.fuzz` runs thousands."""
    status, report, log = fuzz(tmp_path / "data", 8, "examples,fuzzing")
    assert status == 0, report
    assert "Traceback" not in log
