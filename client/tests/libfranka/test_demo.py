"""Our own scenes behind libfranka's protocol, taught and solved by the driver."""

import json
import subprocess
import sys

import numpy as np
import pytest

from app.pipeline.keyframes import Motion, merged
from app.sim.libfranka.demonstrate import ServedScene, record_demonstration, rollout
from roboprompt_client import EndEffectorAction

NEAR_M, NEAR_DEG = 0.001, 0.2
SLOW_M = 0.003  # what 0.1 rad/s, still at rest to the rule, moves a hand 0.6 m away in a frame of 50 ms


@pytest.fixture(scope="module")
def recorded():
    return record_demonstration("push_button", seed=0, images=False)


def test_the_driver_presses_the_button(recorded):
    assert recorded.failure == ""


def test_what_the_driver_reports_has_the_expert_s_poses_as_keyframes(recorded):
    trajectory, actions = recorded.trajectory, recorded.expert_actions
    found = [trajectory.action_at(index) for index in merged(Motion.of(trajectory))]
    assert len(found) == len(actions)
    for keyframe, action in zip(found, actions, strict=True):
        np.testing.assert_allclose(keyframe.position_m, action.position_m, atol=SLOW_M)
        assert keyframe.gripper_open == action.gripper_open


def test_a_wrong_button_is_no_success(recorded):
    """The scene judges, not the arm, which arrives everywhere."""
    result = rollout("push_button", 0, recorded.expert_actions, variation=1)
    assert not result.succeeded
    assert "not solved" in result.failure
    assert len(result.misses) == len(recorded.expert_actions)
    assert all(off_m < NEAR_M and off_deg < NEAR_DEG for off_m, off_deg in result.misses)


def test_out_of_reach_ends_a_rollout(recorded):
    near, far = recorded.expert_actions[0], recorded.expert_actions[1]
    beyond = EndEffectorAction(far.position_m + np.array([1.0, 0, 0]), far.quaternion_xyzw, far.gripper_open)
    result = rollout("push_button", 0, [near, beyond, near])
    assert (result.succeeded, result.num_executed) == (False, 1)
    assert result.failure.startswith("action 2 of 3: the pose is out of reach")


def test_fingers_hold_what_they_close_on():
    assert record_demonstration("stack_cube", seed=0, images=False).failure == ""


def test_a_scene_ends_with_its_user():
    with ServedScene("push_button", 0, 0) as served:
        assert served.address.startswith("127.62.")
        process = served._process
    assert process.returncode == 0


def test_the_demo(tmp_path):
    """The whole loop, the service included."""
    options = ["--robot", "franka", "--task", "push_button", "--demos", "4", "--episodes", "1", "--no-compare"]
    command = [sys.executable, "-m", "app.cli", "demo", *options, "--json", "--report", tmp_path / "report"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    answer = json.loads(done.stdout.splitlines()[-1])
    assert answer["tasks"]["push_button"]["successes"] == 1
    assert answer["reached"]["poses"] == 3
    assert answer["reached"]["worst_mm"] < 1000 * NEAR_M
