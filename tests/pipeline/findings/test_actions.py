"""Actions that are not where demonstrations have them: one finding for a cause, whatever the number of rows."""

import pytest

from app.pipeline.errors import UnsupportedActionError
from app.pipeline.findings.actions import ActionDoubt, action_findings


def unsupported(index):
    return ActionDoubt(index, unsupported=UnsupportedActionError(index, "is 20.0 cm from it", "within 3 cm"))


def test_without_doubts_there_is_no_finding():
    assert action_findings(()) == ()


@pytest.mark.parametrize(
    ("indices", "named"),
    [
        ([1], "actions[1] is 20.0 cm from it (expected: within 3 cm)."),
        ([0, 2], "Actions 1 and 3 are unlike"),
        ([0, 1, 2], "Actions 1, 2 and 3 are unlike"),
        (range(12), "Actions 1, 2, 3, 4 and 8 more are unlike"),
    ],
)
def test_unsupported_rows_are_one_danger_that_names_them(indices, named):
    (finding,) = action_findings([unsupported(index) for index in indices])
    assert (finding.code, finding.severity) == ("unsupported-action", "danger")
    assert finding.message.startswith(named)
    assert finding.where == f"actions[{indices[0]}]"
    assert finding.numbers["num_actions"] == len(indices)


def test_rows_that_stray_are_one_finding_with_the_farthest():
    (finding,) = action_findings([ActionDoubt(0, 0.012, 1.0, "cube"), ActionDoubt(2, 0.024, 9.0, "box")])
    assert (finding.code, finding.severity, finding.where) == ("straying-action", "info", "actions[0]")
    assert finding.message.startswith("Actions 1 and 3 lie up to 2.4 cm and 9 degrees beyond")
    assert "seen from box" in finding.message


def test_both_kinds_are_two_findings_the_danger_first():
    found = action_findings([ActionDoubt(0, 0.012, 0.0, "cube"), unsupported(1)])
    assert [finding.code for finding in found] == ["unsupported-action", "straying-action"]
