"""What recordings that went wrong leave: never an exception, and no keyframe that was not recorded."""

from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.findings.recording import recording_findings
from app.pipeline.keyframes import RULES, KeyframeRule, Motion, find_keyframes, manner_of, waypoints
from roboprompt_client.types.trajectory import Trajectory

from ..recordings import flowing
from ..scenes import rotated

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


@pytest.mark.parametrize(("rate_hz", "coarse"), [(2, True), (20, False)])
def test_few_frames_for_so_fast_a_motion_are_reported(rate_hz, coarse):
    recorded = WAY.at(rate_hz)
    motion, rule = Motion.of(recorded, rate_hz), KeyframeRule("auto")
    found = recording_findings(motion, find_keyframes(motion, rule), rule)
    assert ("coarse-recording" in [finding.code for finding in found]) is coarse


@pytest.mark.parametrize(("missing", "found"), [(slice(15, 45), ["jump"]), (slice(15, 18), [])])
def test_frames_that_are_missing_on_the_way_are_reported(missing, found):
    recorded = WAY.at(20)
    kept = np.delete(np.arange(len(recorded)), missing)
    motion = Motion.of(recording(recorded.positions_m[kept], timestamps_s=kept / 20))
    codes = [item.code for item in recording_findings(motion, [None], KeyframeRule("auto"))]
    assert [code for code in codes if code == "jump"] == found


@pytest.mark.parametrize(("turn_deg", "found"), [(0.0, ["rotation-not-measured"]), (0.01, [])])
def test_a_rotation_that_is_exactly_the_identity_throughout_is_reported(turn_deg, found):
    recorded = WAY.at(20)
    turns = np.tile(rotated(0, 0, turn_deg).as_quat(), (len(recorded), 1))
    motion = Motion.of(replace(recorded, quaternions_xyzw=turns))
    codes = [item.code for item in recording_findings(motion, [None], KeyframeRule("auto"))]
    assert [code for code in codes if code == "rotation-not-measured"] == found


@pytest.mark.parametrize(("closes_to_m", "severity"), [(0.02, "warning"), (0.079, "info")])
def test_fingers_that_move_while_the_gripper_has_one_state_are_reported(closes_to_m, severity):
    """A threshold that no width crosses loses every grasp."""
    way = WAY.at(20)
    widths_m = np.linspace(0.08, closes_to_m, len(way))
    motion, rule = Motion.of(replace(way, gripper_open=np.ones(len(way)), gripper_width_m=widths_m)), KeyframeRule()
    found = {finding.code: finding for finding in recording_findings(motion, find_keyframes(motion, rule), rule)}
    assert found["one-gripper-state"].severity == severity
