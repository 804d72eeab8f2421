"""What recordings that went wrong leave: never an exception, and no keyframe that was not recorded."""

import numpy as np
import pytest

from app.pipeline.keyframes import RULES, KeyframeRule, Motion, find_keyframes, manner_of, waypoints
from roboprompt_client.types.trajectory import Trajectory

from ..recordings import flowing

DOWN_XYZW = (1.0, 0.0, 0.0, 0.0)
WAY = flowing([(0.0, 0.0, 1.0), (0.3, 0.0, 1.0), (0.3, 0.3, 1.0)], blend_s=1e-6)


def recording(positions_m, gripper_open=None, timestamps_s=None):
    positions_m = np.array(positions_m, dtype=float)
    number = len(positions_m)
    speeds = np.zeros((number, 7))
    speeds[1:, 0] = 20 * np.linalg.norm(np.diff(positions_m, axis=0), axis=1)
    is_open = np.ones(number, dtype=bool) if gripper_open is None else np.array(gripper_open, dtype=bool)
    return Trajectory(speeds, positions_m, np.tile(DOWN_XYZW, (number, 1)), is_open, timestamps_s)


@pytest.mark.parametrize("rule", RULES)
def test_a_single_frame_has_no_keyframe(rule):
    assert find_keyframes(Motion.of(recording([(0, 0, 1)])), KeyframeRule(rule)) == ()


@pytest.mark.parametrize("rule", ["auto", "waypoints", "merged"])
def test_without_motion_only_the_last_frame_is_one(rule):
    still = recording([(0.1, 0.2, 1.0)] * 50)
    assert [keyframe.frame for keyframe in find_keyframes(Motion.of(still), KeyframeRule(rule))] == [49]


def test_a_jump_is_kept_to_the_frame():
    """20 cm within one frame: both of its ends stay on the path."""
    recorded = WAY.at(20)
    positions_m = recorded.positions_m.copy()
    positions_m[20:, 2] += 0.2
    found = [frame for frame, _ in waypoints(Motion.of(recording(positions_m)))]
    assert {19, 20} <= set(found)
    assert found[-1] == len(positions_m) - 1


def test_timestamps_may_begin_anywhere():
    recorded = WAY.at(20)
    times_s = np.arange(len(recorded)) / 20
    now, later = (Motion.of(recording(recorded.positions_m, timestamps_s=times_s + at_s)) for at_s in (0, 1.7e9))
    assert find_keyframes(later, KeyframeRule("auto")) == find_keyframes(now, KeyframeRule("auto"))


def test_a_gripper_that_never_settles_has_one_switch_at_most():
    """It flickers with every frame of 20 Hz: half a cycle is shorter than fingers take."""
    recorded = WAY.at(20)
    flickering = recording(recorded.positions_m, np.arange(len(recorded)) % 2 == 0)
    found = waypoints(Motion.of(flickering))
    assert len({keyframe.gripper_open for keyframe in found}) <= 2
    assert len(found) <= 3


@pytest.mark.parametrize("seed", range(6))
def test_noise_alone_is_no_reason_for_an_error(seed):
    random = np.random.default_rng(seed)
    number = int(random.integers(2, 60))
    noise = Motion.of(recording(random.normal(0, 0.3, (number, 3)), random.integers(0, 2, number)))
    assert manner_of(noise) in ("rests", "hesitates", "flows")
    found = find_keyframes(noise, KeyframeRule("auto"))
    assert all(0 < keyframe.frame < number for keyframe in found)
