import pytest

from app.pipeline.findings.elsewhere import unlike_findings

from ..scenes import action, demonstration, pose

CUBE = pose("cube", (0.1, 0.0, 0.8))
PICKS, SLIPS = (True, False, False), (True, False, True, False)


def shown(grippers, instruction="pick up the cube"):
    return demonstration(instruction, [CUBE], [action((0.1, 0.0, 0.9), gripper_open=is_open) for is_open in grippers])


@pytest.mark.parametrize(
    ("new", "others", "named"),
    [
        (SLIPS, [PICKS] * 9, True),
        (SLIPS, [PICKS] * 3, True),
        (SLIPS, [PICKS] * 2, False),  # too few to tell
        (SLIPS, [PICKS] * 3 + [SLIPS], False),  # two of five are no slip
        (PICKS, [PICKS] * 9, False),
        ((False, False), [PICKS] * 9, False),  # the hand comes without a pose before the grasp
        ((), [PICKS] * 9, True),
    ],
)
def test_an_upload_whose_gripper_does_something_else_is_named(new, others, named):
    found = list(unlike_findings(shown(new), [shown(item) for item in others]))
    assert [finding.code for finding in found] == ["left-out"] * named


def test_other_instructions_are_not_compared():
    assert not list(unlike_findings(shown(SLIPS, "move the cube"), [shown(PICKS)] * 9))
