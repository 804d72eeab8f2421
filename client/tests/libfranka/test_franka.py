"""A Franka arm through libfranka's own protocol: what it does, and what goes wrong on the way."""

import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import ADDRESS, FAST, opened

from roboprompt_client import EndEffectorAction, MotionError, ObjectPose, Observation, PredictedActions, run_task
from roboprompt_client.arms.franka import Franka
from roboprompt_client.arms.named import flange
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.types import quaternions as rotations

FREE = MotionLimits(hand_radius_m=0.0)
NEAR_M, NEAR_DEG = 0.001, 0.1
STILL_RAD = 0.002
BRAKING_S = 0.5
PUSH_S, PATIENCE_S = 10.0, 120.0


def to(arm, offset_m=(0.05, 0.03, -0.08), gripper_open=True, turn_rad=0.0):
    state = arm.state()
    turned = rotations.product(rotations.about_z(turn_rad), state.quaternion_xyzw)
    return EndEffectorAction(state.position_m + np.array(offset_m), turned, gripper_open)


def clock_s(arm):
    """The time of the simulation, which passes more slowly than ours on a busy machine."""
    return arm.driver._robot.state.time.to_sec()


def let_pass(arm, duration_s):
    """Wait until so much time has passed for the arm."""
    end_s, patient_until_s = clock_s(arm) + duration_s, time.monotonic() + PATIENCE_S
    while clock_s(arm) < end_s:
        assert time.monotonic() < patient_until_s
        time.sleep(0.005)


def assert_stands_still(arm):
    """Its joints stay where they are; their velocities tremble in the simulation (0.08 rad/s within 0.1 mrad)."""
    let_pass(arm, BRAKING_S)
    places = []
    for _ in range(10):
        places.append(arm.state().joint_positions_rad)
        let_pass(arm, 0.03)
    assert np.ptp(places, axis=0).max() < STILL_RAD


def assert_stopped(arm, gripper_m=None):
    """Still, and nothing moves it before a person says so."""
    assert_stands_still(arm)
    with pytest.raises(MotionError, match="recover"):
        arm.execute(to(arm))
    assert_stands_still(arm)
    if gripper_m is not None:
        assert arm.state().gripper_width_m == pytest.approx(gripper_m, abs=0.002)


def test_it_arrives_within_a_millimeter(arm):
    for k, offset_m in enumerate([(0.05, 0.03, -0.08), (-0.08, -0.1, 0.05), (0.03, 0.07, 0.03)]):
        action = to(arm, offset_m, gripper_open=k % 2 == 0, turn_rad=0.2 * (-1) ** k)
        arm.execute(action)
        off_m, off_deg = arm.state().distance_to(action.position_m, action.quaternion_xyzw)
        assert off_m < NEAR_M
        assert off_deg < NEAR_DEG
        assert arm.state().gripper_width_m == pytest.approx(0.08 if k % 2 == 0 else 0.0, abs=0.004)


def test_an_action_at_the_same_pose_sets_the_gripper_alone(arm):
    here = to(arm, (0, 0, 0))
    for is_open in (False, True, False):
        arm.execute(EndEffectorAction(here.position_m, here.quaternion_xyzw, is_open))
        assert arm.state().gripper_width_m == pytest.approx(0.08 if is_open else 0.0, abs=0.004)


def test_our_geometry_is_the_arm_s(arm):
    tip = np.array(arm.driver._robot.state.F_T_EE.matrix)
    state = arm.state()
    np.testing.assert_allclose((flange(state.joint_positions_rad)[0] @ tip)[:3, 3], state.position_m, atol=1e-5)


@pytest.mark.parametrize(
    ("offset_m", "turn_rad", "message"), [((0.6, 0, 0), 0, "out of reach"), ((0, 0, 0), -2.6, r"joint 7 would come to")]
)
def test_out_of_reach_and_beyond_a_joint_s_limit_nothing_moves(arm, offset_m, turn_rad, message):
    before = arm.state().position_m
    with pytest.raises(MotionError, match=message):
        arm.execute(to(arm, offset_m, turn_rad=turn_rad))
    np.testing.assert_allclose(arm.state().position_m, before, atol=NEAR_M)
    assert_stopped(arm)
    arm.recover()
    arm.execute(to(arm))


@pytest.mark.parametrize("after_s", [0.05, 0.3, 0.6])
def test_a_stop_from_another_thread(simulated, after_s):
    with opened(dynamics=0.1) as arm:
        goal = to(arm, (0.1, 0.1, -0.2), gripper_open=False)
        width_m = arm.state().gripper_width_m
        threading.Timer(after_s, arm.stop).start()
        with pytest.raises(MotionError):
            arm.execute(goal)
        assert arm.state().distance_to(goal.position_m, goal.quaternion_xyzw)[0] > 0.02
        assert_stopped(arm, width_m)
        arm.recover()
        arm.execute(goal)


def test_a_gripper_that_is_blocked(simulated, arm):
    arm.execute(to(arm, gripper_open=True))
    simulated.tell("jam")
    with pytest.raises(MotionError, match="was to close, but still measures"):
        arm.execute(to(arm, gripper_open=False))
    assert_stopped(arm)
    simulated.tell("free")
    arm.recover()
    arm.execute(to(arm, (0, 0, 0.02), gripper_open=False))
    simulated.tell("jam")
    with pytest.raises(MotionError, match=r"was to open, but measures"):
        arm.execute(to(arm, (0, 0, 0.02), gripper_open=True))


def test_a_gripper_that_starts_closed(simulated):
    with opened() as arm:
        arm.set_gripper(is_open=False)
    with opened() as arm:
        for is_open in (False, True, False):
            arm.execute(to(arm, (0, 0, 0), gripper_open=is_open))
            assert arm.state().gripper_width_m == pytest.approx(0.08 if is_open else 0.0, abs=0.004)


class Slips:
    """The arm's gripper, whose grasps are reported as failed."""

    def __init__(self, hand):
        self._hand, self.stops = hand, 0

    def __getattr__(self, name):
        return getattr(self._hand, name)

    def grasp(self, *how):
        self._hand.grasp(*how)
        raise RuntimeError("libfranka gripper: Command failed!")

    def stop(self):
        self.stops += 1
        return self._hand.stop()


def test_a_stop_after_a_failed_grasp_keeps_the_grip(arm):
    arm.driver._gripper = hand = Slips(arm.driver._gripper)
    with pytest.raises(MotionError, match="Command failed"):
        arm.execute(to(arm, (0, 0, 0), gripper_open=False))
    arm.stop()
    assert hand.stops == 0
    assert arm.state().gripper_width_m == pytest.approx(0.0, abs=0.004)
    arm.driver._gripper = hand._hand


def test_a_connection_that_is_cut_in_a_motion(simulated):
    with opened(dynamics=0.1) as arm:
        goal = to(arm, (0.1, 0.1, -0.2))
        threading.Timer(0.5, simulated.kill).start()
        began_s = time.monotonic()
        with pytest.raises(MotionError):
            arm.execute(goal)
        assert time.monotonic() - began_s < PATIENCE_S
        with pytest.raises(MotionError, match="was stopped"):
            arm.execute(goal)


def test_a_program_that_dies_in_a_motion_leaves_a_still_arm(simulated):
    with moving(0.1) as program:
        time.sleep(0.5)
        program.kill()
        program.wait()
    time.sleep(0.5)
    with opened() as arm:
        assert_stands_still(arm)


class moving:  # noqa: N801
    """A program of its own that moves the arm."""

    def __init__(self, dynamics):
        self._command = [sys.executable, Path(__file__).with_name("mover.py"), ADDRESS, str(dynamics)]

    def __enter__(self):
        self.program = subprocess.Popen(self._command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.program.stdout.readline() == "ready\n"
        assert self.program.stdout.readline() == "moving\n"
        return self.program

    def __exit__(self, *_):
        self.program.kill()
        self.program.communicate()


def test_an_interrupt_at_twenty_random_moments(simulated):
    moments = random.Random(0)
    for _ in range(20):
        with moving(FAST) as program:
            time.sleep(moments.uniform(0.0, 1.5))
            program.send_signal(signal.SIGINT)
            _, said = program.communicate(timeout=PATIENCE_S)
            assert "KeyboardInterrupt" in said
            assert program.returncode != 0
        with opened() as arm:
            assert_stands_still(arm)


def test_a_second_program_is_refused_and_the_first_goes_on(simulated, arm):
    with pytest.raises(MotionError):
        Franka(ADDRESS, realtime=False)
    arm.execute(to(arm))


class Service:
    """Answers as the test asks it to."""

    def __init__(self, *answers):
        self._answers = list(answers)

    def predict(self, *_, **__):
        return self._answers.pop(0)

    def get(self, path):
        return {}

    def motion_limits(self, task):
        return FREE


def test_an_object_that_moves_before_contact_is_followed(simulated):
    with opened() as arm:
        above, at = to(arm, (0, 0, -0.05)), to(arm, (0, 0, -0.12), gripper_open=False)
        places = iter([(0.0, 0.0), (0.0, 0.0), (0.03, -0.02), (0.03, -0.02)])

        def look():
            x_m, y_m = next(places)
            return Observation((ObjectPose("cube", at.position_m + np.array([x_m, y_m, 0.0]), [0, 0, 0, 1]),))

        arm._observe_scene = look
        anchor = {"object": "cube", "frame": "w", "offset_m": [0, 0, 0], "rotation_xyzw": [1, 0, 0, 0]}
        anchor |= {"tolerance_m": 0.01, "tolerance_deg": 5}
        items = [
            {
                "position": action.position_m.tolist(),
                "quaternion_xyzw": action.quaternion_xyzw.tolist(),
                "gripper_open": action.gripper_open,
                "anchor": anchor,
            }
            for action in (above, at)
        ]
        service = Service(PredictedActions.from_json({"id": "p", "actions": items, "findings": []}))
        run_task(service, arm, "t", "go", look_again=True)
        off_m = arm.state().position_m - at.position_m
        np.testing.assert_allclose(off_m, [0.03, -0.02, 0.0], atol=NEAR_M)


def test_a_guided_arm_yields_and_holds_still_afterwards(simulated, arm):
    before_m = arm.state().position_m
    with arm.guided():
        arm.set_gripper(is_open=False)
        sunk_m = np.linalg.norm(arm.state().position_m - before_m)
        simulated.tell("push")
        end_s = clock_s(arm) + PUSH_S
        while (pushed_m := arm.state().position_m - before_m)[1] < 0.02 and clock_s(arm) < end_s:
            time.sleep(0.02)
        simulated.tell("release")
    assert sunk_m < 0.005
    assert pushed_m[1] >= 0.02
    assert arm.state().gripper_width_m == pytest.approx(0.0, abs=0.004)
    assert_stands_still(arm)
    arm.execute(to(arm))


def test_nothing_else_moves_an_arm_that_is_guided(arm):
    with pytest.raises(MotionError, match="another thread"), arm.guided():
        arm.execute(to(arm))


def test_a_stop_ends_the_guidance(arm):
    with pytest.raises(MotionError, match=r"preempted|was stopped"), arm.guided():
        arm.stop()
    assert_stopped(arm)
