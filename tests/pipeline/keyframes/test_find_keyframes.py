from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.pipeline.keyframes import RULES, KeyframeRule, Motion, find_keyframes, manner_of, merged, waypoints
from app.pipeline.keyframes.path import TOLERANCE_DEG, TOLERANCE_M
from roboprompt_client.types.trajectory import Trajectory

from ..recordings import ScriptedMotion, flowing, pick_and_place, resting
from .test_published import trajectory

PICK_M, PLACE_M = (0.3, 0.1, 0.8), (0.0, -0.2, 0.82)
FRAMES = st.lists(st.tuples(st.sampled_from("m."), st.sampled_from("01")), min_size=1, max_size=60)


@pytest.mark.parametrize("rule", RULES)
@given(frames=FRAMES, interval=st.integers(1, 80))
def test_keyframes_ascend_within_range_and_never_begin_at_the_first_frame(rule, frames, interval):
    recorded = trajectory([motion for motion, _ in frames], "".join(gripper for _, gripper in frames))
    found = find_keyframes(Motion.of(recorded), KeyframeRule(rule, interval=interval))
    numbers = [keyframe.frame for keyframe in found]
    assert numbers == sorted(set(numbers))
    assert all(0 < frame < len(frames) for frame in numbers)
    assert bool(found) == (len(frames) > 1)
    assert all(type(frame) is int and type(gripper_open) is bool for frame, gripper_open in found)


def frames_of(recorded, rule):
    return tuple(keyframe.frame for keyframe in find_keyframes(Motion.of(recorded), rule))


def test_the_rule_chooses():
    recorded = trajectory("." * 14)
    assert frames_of(recorded, KeyframeRule("merged")) == (13,)
    assert frames_of(recorded, KeyframeRule("authors")) == (5, 10, 13)
    assert frames_of(recorded, KeyframeRule("uniform", interval=6)) == (6, 12, 13)
    assert frames_of(trajectory("mmm.mmmmmm"), KeyframeRule("merged", delta_rad_s=1.0)) == (9,)


@pytest.mark.parametrize("hz", [6, 20, 60])
@pytest.mark.parametrize("seed", range(3))
def test_a_recording_that_rests_at_its_corners_gives_what_merged_finds(seed, hz):
    random = np.random.default_rng(seed)
    ends_m = random.uniform([-0.2, -0.3, 0.78], [0.4, 0.3, 0.84], (2, 3))
    recorded = pick_and_place(*ends_m, move=resting).at(hz)
    assert manner_of(Motion.of(recorded)) == "rests"
    found = frames_of(recorded, KeyframeRule("auto"))
    assert found == merged(Motion.of(recorded))
    assert len(found) == 6


@pytest.mark.parametrize("turn_deg", [-120, 360])
def test_a_rest_after_a_whole_turn_is_not_enough(turn_deg):
    """Its two ends are one rotation, so that only keyframes between tell that the hand turns."""
    turned = ScriptedMotion(
        ((0, (0.1, 0.0, 1.0)), (1, PICK_M), (1.4, PICK_M), (6, PICK_M), (7, (0.1, 0.0, 1.0)), (7.4, (0.1, 0.0, 1.0))),
        turns=((1.4, 0.0), (5.6, turn_deg)),
        switches=(1.2,),
        rest_s=0.4,
    )
    assert manner_of(Motion.of(turned.at(20))) == ("flows" if abs(turn_deg) > 150 else "rests")


def by_waypoints(recorded, wavering=1.0):
    return waypoints(Motion.of(recorded), wavering * TOLERANCE_M, wavering * TOLERANCE_DEG)


@pytest.mark.parametrize("hz", [10, 20, 60])
def test_a_hand_that_flows_is_followed(hz):
    recorded = pick_and_place(PICK_M, PLACE_M, move=flowing).at(hz)
    assert manner_of(Motion.of(recorded)) == "flows"
    assert find_keyframes(Motion.of(recorded), KeyframeRule("auto")) == by_waypoints(recorded)


@pytest.mark.parametrize("hz", [10, 20, 60])
def test_a_pose_that_is_passed_between_two_rests_is_found(hz):
    """A sweep: the hand rests where it grasps the broom and at the end, and turns behind the dirt without a rest."""
    above_m, grasp_m, behind_m, end_m = (0.2, 0.1, 1.0), (0.2, 0.1, 0.85), (0.1, -0.1, 0.85), (0.4, -0.15, 0.85)
    knots = ((0, above_m), (0.4, above_m), (1.4, grasp_m), (2.0, grasp_m), (3.2, behind_m), (5.0, end_m), (5.6, end_m))
    recorded = ScriptedMotion(knots, switches=(1.7,), blend_s=0.2).at(hz)
    assert manner_of(Motion.of(recorded)) == "flows"
    places_m = recorded.positions_m[
        [keyframe.frame for keyframe in find_keyframes(Motion.of(recorded), KeyframeRule("auto"))]
    ]
    assert np.linalg.norm(places_m - behind_m, axis=1).min() < 0.02
    assert np.linalg.norm(recorded.positions_m[list(merged(Motion.of(recorded)))] - behind_m, axis=1).min() > 0.1


def hesitating(seed, rest_s):
    """From place to place with rests on straight ways, not only at the ends."""
    random = np.random.default_rng(seed)
    ends_m = [(0.1, 0.0, 1.1), (0.3, 0.1, 0.95), (0.3, 0.1, 0.8), (0.3, 0.1, 1.0)]
    stops_m = [np.array(ends_m[0])]
    for start_m, end_m in pairwise(ends_m):
        parts = np.sort(random.uniform(0.2, 0.8, 2))
        stops_m += [np.array(start_m) + part * np.subtract(end_m, start_m) for part in (*parts, 1.0)]
    return resting(stops_m, rest_s=rest_s, tremor_m=0.001)


@pytest.mark.parametrize("rest_s", [0.3, 2.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_hand_that_hesitates_is_followed_less_closely(seed, rest_s):
    recorded = hesitating(seed, rest_s).at(20)
    assert manner_of(Motion.of(recorded)) == "hesitates"
    found = find_keyframes(Motion.of(recorded), KeyframeRule("auto"))
    assert found == by_waypoints(recorded, 1.5)
    assert len(found) < len(merged(Motion.of(recorded)))


def test_the_control_frequency_stands_in_for_timestamps():
    """A blip is recognized by its length in seconds: 2 frames are one at 50 Hz and a switch at 10 Hz."""
    motion = flowing([(0.0, 0.0, 1.0), (0.3, 0.0, 1.0)]).at(20)
    is_open = np.ones(len(motion), dtype=bool)
    is_open[15:17] = False
    recorded = Trajectory(motion.joint_velocities_rad_s, motion.positions_m, motion.quaternions_xyzw, is_open)
    grippers = {
        hz: [gripper_open for _, gripper_open in find_keyframes(Motion.of(recorded, hz), KeyframeRule("waypoints"))]
        for hz in (10, 50)
    }
    assert grippers == {10: [False, True, True], 50: [True]}
