"""The robot's loop: whatever goes wrong, the arm is stopped."""

from dataclasses import replace

import pytest
from arms import ANSWER, Arm, Service

from roboprompt_client.errors import (
    InvalidInputError,
    MotionError,
    NotConfirmedError,
    ServiceProblemError,
    UnsafeActionError,
)
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.runs.loop import run_task
from roboprompt_client.types.poses import Pose


def test_actions_are_executed_in_order():
    arm = Arm()
    assert run_task(Service(ANSWER), arm, "pick", "pick up the cube") is ANSWER
    assert (arm.heights, arm.stopped) == ([1.0, 0.9, 0.8], 0)


@pytest.mark.parametrize("error", [MotionError("blocked"), KeyboardInterrupt(), RuntimeError("cable")])
def test_the_arm_is_stopped_where_it_fails(error):
    arm = Arm(fails_at=1, error=error)
    with pytest.raises(type(error)):
        run_task(Service(ANSWER), arm, "pick", "pick up the cube")
    assert (arm.heights, arm.stopped) == ([1.0], 1)


def test_an_arm_that_fails_to_stop_hides_no_error(monkeypatch, caplog):
    def cut():
        raise OSError("no cable")

    arm = Arm(fails_at=1, error=MotionError("joint 3 is too hot"))
    monkeypatch.setattr(arm, "stop", cut)
    with pytest.raises(MotionError, match="too hot"):
        run_task(Service(ANSWER), arm, "pick", "pick up the cube")
    assert "the stop was not confirmed: no cable" in caplog.text


def test_a_person_can_stop_before_an_action():
    arm = Arm()
    with pytest.raises(NotConfirmedError, match="action 2 was not allowed"):
        run_task(Service(ANSWER), arm, "pick", "pick up the cube", confirm=lambda index, action: index < 1)
    assert (arm.heights, arm.stopped) == ([1.0], 1)


def test_nothing_moves_without_an_answer():
    arm = Arm()
    with pytest.raises(ServiceProblemError):
        run_task(Service(ServiceProblemError(502, {"title": "no"})), arm, "pick", "pick up the cube")
    assert (arm.heights, arm.stopped) == ([], 1)


HIGH = MotionLimits(Box((-1, -1, 0.85), (1, 1, 2)))


def test_more_actions_than_asked_for_are_not_carried_out():
    arm = Arm()
    with pytest.raises(UnsafeActionError, match="at most 2 actions"):
        run_task(Service(ANSWER), arm, "pick", "pick up the cube", max_actions=2)
    assert arm.stopped == 1


def test_a_long_plan_is_carried_out_without_a_word_about_its_length():
    arm = Arm()
    run_task(Service(replace(ANSWER, actions=10 * ANSWER.actions)), arm, "pick", "pick up the cube")
    assert len(arm.heights) == 30


START = Pose((0.1, 0.2, 1.05), (1.0, 0, 0, 0))
SHORT = MotionLimits(max_step_m=0.09)


@pytest.mark.parametrize(
    ("pinned", "breach"),
    [
        (HIGH, "action 2: position.z is 0.8 m"),
        (SHORT, r"action 1: position is 0\.1 m from the one before"),
        (MotionLimits(keep_out=(Box((0, 0, 0.82), (1, 1, 0.83)),)), r"action 2: .*keep_out\[0\]"),
        (MotionLimits(keep_out=(Box((0.16, 0, 0.9), (1, 1, 1.1)),), hand_radius_m=0.07), "action 0: .*0.07 m"),
    ],
)
def test_what_the_robot_pins_holds_however_wide_the_services_limits_are(pinned, breach):
    arm = Arm(end_effector=START)
    with pytest.raises(UnsafeActionError, match=breach):
        run_task(Service(ANSWER, MotionLimits()), arm, "pick", "pick up the cube", pinned=pinned)
    assert (arm.heights, arm.stopped) == ([], 1)


def test_the_services_limits_hold_beside_the_pinned():
    arm = Arm(end_effector=START)
    with pytest.raises(UnsafeActionError, match="action 2"):
        run_task(Service(ANSWER, HIGH), arm, "pick", "pick up the cube", pinned=MotionLimits(max_step_m=1.0))
    assert (arm.heights, arm.stopped) == ([], 1)


def test_limits_without_room_in_common_move_nothing():
    arm, service = Arm(), Service(ANSWER)
    with pytest.raises(InvalidInputError, match="workspace"):
        run_task(service, arm, "pick", "pick", pinned=MotionLimits(Box((5, 5, 5), (6, 6, 6))))
    assert (arm.heights, arm.stopped, service.asked) == ([], 1, 0)


def test_bounded_steps_need_to_know_where_the_arm_is():
    arm, service = Arm(), Service(ANSWER)
    with pytest.raises(InvalidInputError, match="end_effector"):
        run_task(service, arm, "pick", "pick up the cube", pinned=SHORT)
    assert (arm.heights, arm.stopped, service.asked) == ([], 1, 0)
