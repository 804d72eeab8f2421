"""One contract for every arm, over its maker's interface."""

import logging
import threading
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from makers import DOWN, FIRST_M, MAKERS, OPEN_M, Body, Plain

from roboprompt_client.arms.arm import Arm, Tolerance
from roboprompt_client.arms.driver import Calibration
from roboprompt_client.errors import InvalidInputError, MotionError, UnsafeActionError
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.poses import EndEffectorAction


@pytest.fixture
def body():
    return Body()


@pytest.fixture(params=MAKERS)
def driver(request, body, monkeypatch):
    return MAKERS[request.param](body, monkeypatch)


@pytest.fixture
def arm(driver):
    return Arm(driver)


def to(offset_m=(0.05, 0.03, -0.1), gripper_open=True, turn=DOWN):
    return EndEffectorAction(FIRST_M + np.array(offset_m), turn, gripper_open)


def test_it_arrives_and_sets_the_gripper(arm, body):
    turned = rotations.product(rotations.about_z(0.3), DOWN)
    arm.execute(to(gripper_open=False, turn=turned))
    np.testing.assert_allclose(arm.state().position_m, FIRST_M + np.array([0.05, 0.03, -0.1]), atol=1e-6)
    assert rotations.angle_rad(rotations.product(rotations.inverse(turned), arm.state().quaternion_xyzw)) < 1e-6
    hand = arm.observe().end_effector
    np.testing.assert_allclose(hand.position_m, body.position_m, atol=1e-6)
    assert arm.state().gripper_width_m in (None, 0.0)
    arm.execute(to((0, 0, 0), gripper_open=True))
    assert (arm.state().gripper_width_m or 0.08) >= 0.08


def test_its_state_is_in_meters_and_radians(arm):
    state = arm.state()
    np.testing.assert_allclose(state.position_m, FIRST_M, atol=1e-9)
    assert np.abs(state.joint_positions_rad).max() < 4
    assert len(state.joint_positions_rad) in (6, 7)
    assert state.gripper_open is None or state.gripper_open is True


def test_its_base_may_stand_anywhere(driver, body):
    base = Calibration(np.array([1.0, 2.0, 0.5]), rotations.about_z(np.pi / 2))
    arm = Arm(driver, calibration=base)
    position_m, turn = base.to_world(FIRST_M + np.array([0, 0, -0.1]), DOWN)
    np.testing.assert_allclose(arm.state().position_m, base.to_world(FIRST_M, DOWN)[0])
    arm.execute(EndEffectorAction(position_m, turn, True))
    np.testing.assert_allclose(body.position_m, FIRST_M + np.array([0, 0, -0.1]), atol=1e-9)


def test_out_of_reach_nothing_moves_and_the_arm_is_stopped(arm, body):
    with pytest.raises(MotionError, match=r"out of reach|beyond"):
        arm.execute(to((1.0, 0, 0)))
    assert body.starts == 0
    assert body.halts > 0
    with pytest.raises(MotionError, match="recover"):
        arm.execute(to())
    assert body.starts == 0
    arm.recover()
    arm.execute(to())


def test_the_cell_s_limits_hold_before_anything_moves(driver, body):
    arm = Arm(driver, limits=MotionLimits(Box((-1, -1, 0.55), (1, 1, 1)), hand_radius_m=0.0))
    with pytest.raises(UnsafeActionError, match=r"position\.z"):
        arm.execute(to((0, 0, -0.2)))
    assert body.starts == 0


def test_a_motion_that_does_not_arrive_says_how_far_off(arm, body):
    body.blocked = True
    with pytest.raises(MotionError, match=r"ended \d+\.\d mm and \d+\.\d degrees off"):
        arm.execute(to(gripper_open=False))
    assert body.width_m == 0.08  # the gripper was not touched


def test_a_gripper_that_does_not_move_is_noticed(arm, body):
    body.jammed = True
    if arm.state().gripper_width_m is None:
        with pytest.raises(MotionError, match="output"):
            arm.execute(to(gripper_open=False))
        return
    with pytest.raises(MotionError, match=r"to close, but still measures 80\.0 mm"):
        arm.execute(to(gripper_open=False))
    body.jammed = False
    arm.recover()
    arm.execute(to(gripper_open=False))
    body.jammed = True
    with pytest.raises(MotionError, match=r"to open, but measures 0\.0 of 80\.0 mm"):
        arm.execute(to())


@pytest.mark.parametrize("first", [True, False])
def test_a_gripper_that_starts_closed_opens_and_closes(arm, body, first):
    body.width_m = 0.0
    assert arm.state().gripper_open in (None, False)
    for is_open in (first, not first, first):
        arm.execute(to(gripper_open=is_open))
        assert body.width_m == (OPEN_M if is_open else 0.0)


def test_a_gripper_that_starts_closed_and_does_not_open_is_noticed(arm, body):
    body.width_m, body.jammed = 0.0, True
    with pytest.raises(MotionError, match=r"to open, but measures 0\.0|output"):
        arm.execute(to(gripper_open=True))


def test_a_stop_after_a_grasp_that_failed_lets_go_of_nothing(body, monkeypatch):
    arm = Arm(MAKERS["franka"](body, monkeypatch))
    body.slips = True
    with pytest.raises(MotionError, match="Command failed"):
        arm.execute(to(gripper_open=False))
    arm.stop()
    assert (body.width_m, body.let_go) == (0.0, 0)


@pytest.mark.parametrize("is_open", [True, False])
def test_a_width_that_is_not_a_number_is_an_error(driver, monkeypatch, is_open):
    if driver.state().gripper_width_m is None:
        return  # such an arm only knows its last command
    arm, measured = Arm(driver), driver.state
    monkeypatch.setattr(driver, "state", lambda: replace(measured(), gripper_width_m=float("nan")))
    with pytest.raises(MotionError, match="width is nan m"):
        arm.execute(to(gripper_open=is_open))


def test_a_connection_that_is_cut_in_a_motion_is_a_motion_error(arm, body, monkeypatch):
    finished = arm.driver.finished

    def cut():
        body.gone = True
        return finished()

    monkeypatch.setattr(arm.driver, "finished", cut)
    with pytest.raises(MotionError):
        arm.execute(to())
    assert body.starts >= 1
    starts = body.starts
    with pytest.raises(MotionError, match="was stopped"):
        arm.execute(to())
    assert body.starts == starts


@pytest.mark.parametrize("at", range(3))
def test_a_stop_from_another_thread_ends_the_motion(arm, body, monkeypatch, at):
    finished, polls = arm.driver.finished, []

    def poll():
        polls.append(None)
        if len(polls) == at + 1:
            stopper = threading.Thread(target=arm.stop)
            stopper.start()
            stopper.join()
        return finished()

    monkeypatch.setattr(arm.driver, "finished", poll)
    with pytest.raises(MotionError, match="was stopped"):
        arm.execute(to(gripper_open=False))
    assert body.width_m == 0.08
    starts = body.starts
    with pytest.raises(MotionError, match="was stopped"):
        arm.execute(to())
    assert body.starts == starts


def test_an_interrupt_stops_the_arm(arm, monkeypatch):
    def interrupted():
        raise KeyboardInterrupt

    monkeypatch.setattr(arm.driver, "finished", interrupted)
    with pytest.raises(KeyboardInterrupt):
        arm.execute(to())
    with pytest.raises(MotionError, match="was stopped"):
        arm.execute(to())


def test_two_threads_do_not_move_one_arm(arm, monkeypatch):
    finished, refused = arm.driver.finished, []

    def poll():
        if not refused:
            with pytest.raises(MotionError, match="another thread") as caught:
                arm.execute(to())
            refused.append(caught)
        return finished()

    monkeypatch.setattr(arm.driver, "finished", poll)
    arm.execute(to())
    assert refused


def test_a_motion_that_franky_does_not_plan_is_tried_at_other_speeds(body, monkeypatch):
    arm = Arm(MAKERS["franka"](body, monkeypatch))
    body.unplanned = 2
    arm.execute(to())
    assert body.starts == 3
    body.unplanned = 3
    with pytest.raises(MotionError, match="Motion planner failed"):
        arm.execute(to((0, 0, 0)))
    assert body.starts == 6


def test_commands_that_come_too_late_say_what_to_do(body, monkeypatch):
    """libfranka's words for a program that missed the control unit's milliseconds."""
    arm = Arm(MAKERS["franka"](body, monkeypatch))
    reflex = RuntimeError('Move command aborted: motion aborted by reflex! ["communication_constraints_violation"]')
    monkeypatch.setattr(body, "poll", lambda: setattr(body, "error", reflex) or True)
    with pytest.raises(MotionError, match=r"violation.*: commands came too late: end busy programs"):
        arm.execute(to())


QUARTER = Calibration(np.array([1.0, 2.0, 0.5]), rotations.about_z(np.pi / 2))


def test_forces_are_reported_along_the_world_s_axes(driver, body):
    body.force_n = np.array([3.0, 0.0, 4.0])
    state = Arm(driver, calibration=QUARTER).state()
    np.testing.assert_allclose(state.wrench_n_nm, [0, 3, 4, 0, 0, 0.5], atol=1e-12)
    assert state.force_n == pytest.approx(5.0)


def test_a_motion_that_meets_too_much_stops_and_says_where(driver, body):
    arm = Arm(driver, tolerance=Tolerance(max_contact_force_n=20.0))
    arm.execute(to())
    body.force_n = np.array([0.0, 0.0, 24.0])
    with pytest.raises(MotionError, match=r"the hand met 24\.0 N at \[.*\] m, at most 20 N"):
        arm.execute(to((0, 0, 0)))
    assert body.halts > 0
    body.force_n = np.zeros(3)
    with pytest.raises(MotionError, match="recover"):
        arm.execute(to())


def test_a_bound_of_forces_needs_an_arm_that_tells_them(body):
    with pytest.raises(InvalidInputError, match=r"plain reports no forces"):
        Arm(Plain(body), tolerance=Tolerance(max_contact_force_n=20.0))
    for wrong in (-1.0, float("nan"), "20"):
        with pytest.raises(InvalidInputError, match=r"tolerance\.max_contact_force_n"):
            Tolerance(max_contact_force_n=wrong)
    with pytest.raises(InvalidInputError, match=r"tolerance\.position_m"):
        Tolerance(position_m=None)


def test_what_was_never_seen_on_an_arm_says_so_at_the_start(driver, caplog):
    with caplog.at_level(logging.WARNING):
        Arm(driver)
    assert ("untested on hardware" in caplog.text) == (not driver.proven)


@pytest.mark.parametrize(("tool_m", "is_warned"), [(0.0, True), (0.1034, False)])
def test_a_franka_whose_tool_is_not_set_warns_of_the_flange(body, monkeypatch, caplog, tool_m, is_warned):
    body.tool[2, 3] = tool_m
    with caplog.at_level(logging.WARNING):
        MAKERS["franka"](body, monkeypatch)
    assert ("those of the flange" in caplog.text) == is_warned


def test_a_calibration_says_what_it_wants():
    for document in (None, {}, {"base_to_world": {"position": [0, 0, 0], "quaternion_xyzw": [0, 0, 0, 2]}}):
        with pytest.raises(InvalidInputError, match="base_to_world"):
            Calibration.from_json(document)
    raised = {"base_to_world": {"position": [0, 0, 0.5], "quaternion_xyzw": [0, 0, 0, 1]}}
    np.testing.assert_allclose(Calibration.from_json(raised).to_world(np.zeros(3), DOWN)[0], [0, 0, 0.5])


class Moment:
    """A thread that stops an arm when its maker's interface is used the n-th time by the test's own thread."""

    def __init__(self, arm, body, at):
        self._arm, self._body, self._left, self._user = arm, body, at, threading.get_ident()
        self.thread = threading.Thread(target=self._stop)
        self.then = None
        body.on_touch = self._touch

    def _touch(self):
        if threading.get_ident() != self._user:
            return
        self._left -= 1
        if self._left == 0:
            self.thread.start()
            self.thread.join(0.02)  # longer if the stop waits for the command of this moment

    def _stop(self):
        self._arm.stop()
        self.then = self._body.where()

    def end(self):
        """Where the body was after the stop; None if the moment did not come."""
        self._body.on_touch = lambda: None
        if self.thread.ident is not None:
            self.thread.join()
        return self.then


def test_nothing_is_sent_after_a_stop_at_any_moment(arm, body):
    for at in count(1):
        arm.recover()
        arm.execute(to((0, 0, 0)))
        moment, refused = Moment(arm, body, at), False
        try:
            arm.execute(to((0.02, 0.0, -0.01), gripper_open=False))
        except MotionError:
            refused = True
        if (then := moment.end()) is None:
            break
        assert (at, *body.where()) == (at, *then)
        with pytest.raises(MotionError, match="was stopped"):
            arm.set_gripper(is_open=True)
        assert refused or at > 5  # what was done already when it was stopped
    assert at > 5


def test_a_stop_while_the_arm_recovers_holds(arm, monkeypatch):
    arm.stop()
    monkeypatch.setattr(arm.driver, "recover", arm.stop)
    arm.recover()
    with pytest.raises(MotionError, match="was stopped"):
        arm.execute(to())


def test_a_driver_that_raises_in_its_stop_hides_no_error(arm, monkeypatch, caplog):
    def raises(what):
        def call(*_):
            raise what

        return call

    monkeypatch.setattr(arm.driver, "finished", raises(MotionError("joint 3 is too hot")))
    monkeypatch.setattr(arm.driver, "halt", raises(OSError("no cable")))
    with pytest.raises(MotionError, match="too hot"):
        arm.execute(to())
    assert "the stop was not confirmed: no cable" in caplog.text
    with pytest.raises(MotionError, match="was stopped"):
        arm.execute(to())
    arm.close()
