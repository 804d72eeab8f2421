"""A bowl that a script puts on a plate in one flow: it must be lifted in every plan."""

from itertools import pairwise

import numpy as np
import pytest

from app.pipeline.episode import Demonstration, Query
from app.pipeline.groups import by_plan
from app.pipeline.keyframes import KeyframeRule, Motion
from app.pipeline.keyframes.resting import LEFT_M, path_left_m
from app.pipeline.plans import agreeing, aligned_by_plan
from app.pipeline.plans.recording import Recording
from app.pipeline.plans.support import Support

from ..recordings import servoed
from ..scenes import pose

INSTRUCTION = "put the bowl on the plate"
RIM_M = np.array([0.0, 0.05, 0.02])
SCRIPTS = [  # Hz, m/s, 1/s, m, s: some of the recordings of each come to rest at the grasp and the release alone
    (50, 0.13, 8.6, 0.02, 0.3),
    (30, 0.16, 5.1, 0.02, 0.21),
    (30, 0.42, 9.0, 0.02, 0.5),
    (10, 0.37, 5.5, 0.02, 0.62),
    (20, 0.25, 4.0, 0.01, 0.4),
]


def scene(random):
    bowl_m, plate_m = random.uniform([[0.4, -0.25, 0.02], [0.4, 0.05, 0.01]], [[0.6, 0.0, 0.02], [0.6, 0.3, 0.01]])
    return pose("bowl", bowl_m, 0), pose("plate", plate_m, 0)


def recorded(script, random):
    """A recording with a lift of its own, 5 to 15 cm."""
    bowl, plate = scene(random)
    up_m, grasp_m, release_m = (0, 0, random.uniform(0.05, 0.15)), bowl.position_m + RIM_M, plate.position_m + RIM_M
    start_m, above_m = np.array([0.45, 0.0, 0.3]) + random.normal(0, 0.02, 3), (0, 0, 0.1)
    stops_m = [start_m, grasp_m + above_m, grasp_m, grasp_m + up_m, release_m + up_m, release_m, release_m + above_m]
    shown = Demonstration(INSTRUCTION, (bowl, plate), (), id=str(random.integers(10**9)))
    return Recording(shown, Motion.of(servoed(stops_m, (2, 5), *script), script[0]), KeyframeRule())


def lifted_m(actions, grasp_m):
    """How high the closed hand is when it leaves the grasp's place, 2 cm aside, on straight ways between actions."""
    closed = [k for k, action in enumerate(actions) if not action.gripper_open]
    points_m = np.array([actions[k].position_m for k in (*closed, closed[-1] + 1)])
    way_m = np.concatenate([np.linspace(*pair, 200) for pair in pairwise(points_m)])
    aside = np.linalg.norm(way_m[:, :2] - grasp_m[:2], axis=1) > 0.02
    return float(way_m[np.argmax(aside), 2] - grasp_m[2])


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_bowl_is_lifted_in_every_plan(script):
    random = np.random.default_rng(1)
    recordings = [recorded(script, random) for _ in range(10)]
    demonstrations = aligned_by_plan(recordings)
    for item, shown in zip(recordings, demonstrations, strict=True):
        assert path_left_m(item.motion, "flows", shown.actions) < LEFT_M
    objects = scene(random)
    for plan in Support.of(by_plan(agreeing(demonstrations))).placed(Query(INSTRUCTION, objects)):
        assert lifted_m([row.action for row in plan], objects[0].position_m + RIM_M) > 0.03


def test_a_plan_that_loses_its_paths_gets_as_many_keyframes_as_they_need():
    """Even where each recording for itself looks as if it rested at its keyframes."""
    random = np.random.default_rng(1)
    recordings = [recorded(SCRIPTS[0], random) for _ in range(4)]
    for item in recordings:
        few = [keyframe for keyframe in item.keyframes if not 0 < len(item.motion) - keyframe.frame < 60][-4:]
        vars(item).update(manner="rests", keyframes=tuple(few))
    for demonstration, item in zip(aligned_by_plan(recordings), recordings, strict=True):
        assert item.left_m(demonstration.actions) < LEFT_M


def test_a_free_way_of_an_arm_that_rests_does_not_matter():
    """It may be curved; not so from a grasp to its release at once."""
    item = recorded(SCRIPTS[4], np.random.default_rng(0))
    keyframes = item.keyframes
    switches = [k for k, keyframe in enumerate(keyframes[1:], 1) if keyframe.gripper_open != keyframes[k - 1][1]]
    way = item.with_keyframes([keyframes[k] for k in switches]).actions
    assert path_left_m(item.motion, "rests", way) > LEFT_M
    assert path_left_m(item.motion, "rests", way[:1]) == 0.0
