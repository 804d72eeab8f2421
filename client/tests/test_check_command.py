"""`roboprompt-robot check` of arms."""

import numpy as np
import pytest
from makers import Body, Plain

from roboprompt_client.arms.arm import Arm
from roboprompt_client.commands.check import ArmCheck
from roboprompt_client.robot import Observation


@pytest.fixture
def arm():
    return Arm(Plain(Body()))


def check(monkeypatch, capsys, robot, *answers, **what):
    """Whether the robot is sound, and what is printed."""
    left = list(answers)
    monkeypatch.setattr("builtins.input", lambda question: left.pop(0))
    sound = ArmCheck(robot, **what).run()
    assert not left
    return sound, capsys.readouterr().out


def test_a_sound_arm_passes(arm, monkeypatch, capsys):
    sound, said = check(monkeypatch, capsys, arm, "y", moves=True)
    assert sound
    assert "ok    motion: up is +z" in said
    assert "ok    gripper: closes" in said
    assert "stop: " in said


def test_without_leave_nothing_moves(arm, monkeypatch, capsys):
    before = arm.state().position_m
    check(monkeypatch, capsys, arm, "n", moves=True)
    np.testing.assert_array_equal(arm.state().position_m, before)


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


def test_an_adapter_with_the_wrong_frame_fails(arm, monkeypatch, capsys):
    sound, said = check(monkeypatch, capsys, Upside(arm), "y", moves=True)
    assert (sound, "FAIL  " in said) == (False, True)
