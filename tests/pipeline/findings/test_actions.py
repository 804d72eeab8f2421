"""Actions that are not where demonstrations have them, and what the hand passes by; one finding for a cause."""

from dataclasses import replace

import numpy as np
import pytest
from app.pipeline.findings.actions import ActionDoubt, action_findings, passing_findings
from app.pipeline.findings.demonstrated_scenes import ShownScenes

from app.pipeline.errors import UnsupportedActionError

from ..scenes import action, demonstration, pose


def unsupported(index):
    return ActionDoubt(index, unsupported=UnsupportedActionError(index, "is 20.0 cm from it", "within 3 cm"))


def test_without_doubts_there_is_no_finding():
    assert action_findings(()) == ()


@pytest.mark.parametrize(
    ("indices", "named"),
    [
        ([1], "actions[1] is 20.0 cm from it (expected: within 3 cm)."),
        ([0, 2], "Actions 1 and 3 are outside of"),
        ([0, 1, 2], "Actions 1, 2 and 3 are outside of"),
        (range(12), "Actions 1, 2, 3, 4 and 8 more are outside of"),
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
    assert finding.message.startswith("Actions 1 and 3 are up to 2.4 cm and 9 degrees outside")
    assert "relative to box" in finding.message


def test_both_kinds_are_two_findings_the_danger_first():
    found = action_findings([ActionDoubt(0, 0.012, 0.0, "cube"), unsupported(1)])
    assert [finding.code for finding in found] == ["unsupported-action", "straying-action"]


CUP_M, PLATE_M = (0.0, 0.0, 0.8), (0.4, 0.0, 0.8)
ASIDE_M = (0.2, 0.2, 0.8)
INSTRUCTION = "put the cup on the plate"


def carried(vase_m, instruction=INSTRUCTION, names=("cup", "plate", "vase")):
    """A cup is carried straight to a plate, with a vase somewhere."""
    objects = [pose(name, place_m) for name, place_m in zip(names, (CUP_M, PLATE_M, vase_m), strict=True)]
    return demonstration(instruction, objects, [action(CUP_M, gripper_open=False), action(PLATE_M)])


SHOWN = ShownScenes((carried(ASIDE_M), carried((0.1, 0.15, 0.8)), carried((0.3, -0.2, 0.8))))


def found(vase_m, shown=SHOWN, start=None, **how):
    asked = carried(vase_m, **how)
    return list(passing_findings(replace(asked, start=start), asked.actions, shown))


@pytest.mark.parametrize(
    ("off_m", "severities"), [(0.0, ["danger"]), (0.04, ["warning"]), (0.09, []), (0.15, []), (0.5, [])]
)
def test_what_stands_in_the_way_is_named(off_m, severities):
    findings = found((0.2, off_m, 0.8))
    assert [finding.severity for finding in findings] == severities
    for finding in findings:
        assert (finding.code, finding.where) == ("passes-close", "objects[vase]")
        np.testing.assert_allclose(
            [finding.numbers["distance_m"], finding.numbers["demonstrated_m"], finding.numbers["action"]],
            [off_m, 0.15, 1],
        )


def test_the_way_from_the_start_counts_where_the_robot_says_it():
    start = action((-0.2, 0.3, 0.8))
    (finding,) = found((-0.1, 0.15, 0.8), start=start)
    assert finding.numbers["action"] == 0
    assert found((-0.1, 0.15, 0.8)) == []


def test_demonstrations_that_pass_as_close_say_that_it_does_no_harm():
    close = ShownScenes((*SHOWN.demonstrations, carried((0.1, 0.03, 0.8))))
    assert found((0.2, 0.02, 0.8), shown=close) == []


def test_an_object_that_no_demonstration_has_is_not_judged():
    assert found((0.2, 0.0, 0.8), names=("cup", "plate", "lamp")) == []
