"""`roboprompt-robot check` of arms."""

import numpy as np
import pytest
from makers import Body, open_xarm

from roboprompt_client.arms.arm import Arm
from roboprompt_client.commands.check import ArmCheck
from roboprompt_client.robot import Observation


@pytest.fixture
def arm(monkeypatch):
    return Arm(open_xarm(Body(), monkeypatch))


def test_a_sound_arm_passes(arm):
    results = {result.name: result.passed for result in ArmCheck(arm, moves=True).run()}
    assert results["motion: up is +z"]
    assert results["gripper: closes"]
    assert results["stop"] is not False
    assert False not in results.values()


def test_without_leave_nothing_moves(arm):
    before = arm.state().position_m
    asked = []
    ArmCheck(arm, moves=True, confirm=lambda question: asked.append(question)).run()
    np.testing.assert_array_equal(arm.state().position_m, before)
    assert len(asked) == 1


class Upside:
    """An adapter whose up is down, and whose stop does nothing."""

    def __init__(self, arm):
        self._arm = arm

    def observe(self):
        hand = self._arm.observe().end_effector
        x, y, z = hand.position_m
        return Observation(end_effector=hand._replace(position_m=(x, y, 2 - z)))

    def execute(self, action):
        self._arm.execute(action)

    def stop(self):
        pass


def test_an_adapter_with_the_wrong_frame_fails(arm):
    failed = [outcome.name for outcome in ArmCheck(Upside(arm), moves=True).run() if outcome.passed is False]
    assert failed


@pytest.mark.parametrize(("off_m", "passed"), [((0.0, 0.0, 0.0), True), ((0.0, -0.012, 0.005), False)])
def test_a_place_that_is_touched_says_how_far_off_the_arm_takes_itself_to_be(arm, off_m, passed):
    hand_m = np.array(arm.state().position_m)
    check = ArmCheck(arm, confirm=lambda question: "by hand" in question, touched_m=[hand_m - off_m])
    (touch,) = [outcome for outcome in check.run() if outcome.name.startswith("touch")]
    assert touch.passed is passed
    assert ("13.0 mm off (+0.0, -12.0, +5.0 along x, y, z)" in touch.detail) is not passed


def test_a_place_that_is_not_touched_is_left_out(arm):
    check = ArmCheck(arm, confirm=lambda _: False, touched_m=[(0.0, 0.0, 0.0)])
    assert [outcome.passed for outcome in check.run() if outcome.name.startswith("touch")] == [None]
