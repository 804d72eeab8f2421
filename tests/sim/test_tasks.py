"""The contract of every task: each registered task is held to all of it."""

from functools import lru_cache

import numpy as np
import pytest

from app.pipeline.keyframes import Motion, merged
from app.pipeline.workspace import Workspace, discretize_actions, undiscretize_actions
from app.sim.demonstrate import record_demonstration, rollout, view_scene
from app.sim.robot import SimulatedPanda
from app.sim.tasks import ALL_TASKS, TASKS, make_task
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.names import checked_instruction, checked_name

# Of a module's scope, so that all tests of a task follow each other and share what its cameras see.
every_task = pytest.mark.parametrize("name", ALL_TASKS, scope="module")
LONG = pytest.mark.long
# Every third, the others by `pytest -m long`: one renderer draws them all.
SOME = list(ALL_TASKS)[::3]
SOME_OR_LONG = [pytest.param(name, marks=[] if name in SOME else [LONG]) for name in ALL_TASKS]
# Plans of compositions are long: that experts carry them out, tests/evaluation/test_composition.py sees every time.
PAPERS_OR_LONG = [*TASKS, *(pytest.param(name, marks=LONG) for name in ALL_TASKS if name not in TASKS)]
every_expert = pytest.mark.parametrize("name", PAPERS_OR_LONG, scope="module")

WORKSPACE = Workspace.rlbench()
LATER = [pytest.param(seed, marks=LONG) for seed in range(2, 8)]
ONE_MORE = pytest.param(1, marks=LONG)
MAX_KEYFRAMES = 15
MAX_OF_COMPOSITIONS = 25  # as many actions as a reply may have by default
MIN_PIXELS = 200
MIN_SPREAD_M, MIN_SPREAD_RAD = 0.02, 0.1


def xyz(scene):
    return np.array([pose.position_m for pose in scene.objects])


@lru_cache(maxsize=1)
def seen(name, seed):
    return view_scene(name, seed)


@lru_cache(maxsize=8)
def scene_of(name, seed):
    """For tests that only look."""
    return make_task(name, seed)


def front_of(name, seed):
    """What the front camera sees, and the objects' ids in its mask; with all cameras where a test has that anyway."""
    if seed == 0 and name in SOME:
        scene = seen(name, seed)
        return next(frame for frame in scene.frames if frame.camera.name == "front"), scene.mask_ids
    scene = scene_of(name, seed)
    (frame,) = SimulatedPanda(scene, ["front"]).observe().frames
    return frame, scene.mask_ids()


@pytest.mark.parametrize("name", SOME_OR_LONG, scope="module")
def test_the_seed_determines_the_scene(name):
    first, again, other = seen(name, 0), view_scene(name, 0), scene_of(name, 1)
    assert first.instruction == again.instruction
    np.testing.assert_array_equal(xyz(first), xyz(again))
    assert np.abs(xyz(first) - [pose.position_m for pose in other.object_poses()]).max() > MIN_SPREAD_M
    for frame, same in zip(first.frames, again.frames, strict=True):
        np.testing.assert_array_equal(frame.rgb, same.rgb)
        np.testing.assert_array_equal(frame.depth_m, same.depth_m)
        np.testing.assert_array_equal(frame.mask, same.mask)


@every_task
def test_objects_and_instructions_can_stand_in_a_prompt(name):
    task = ALL_TASKS[name]
    scenes = [make_task(name, 0, variation) for variation in range(task.variations)]
    if name in TASKS:  # of compositions scenes may vary instead
        assert len({scene.instruction for scene in scenes}) == task.variations
    for scene in scenes:
        checked_instruction("instruction", scene.instruction)
        assert [checked_name("name", pose.name) for pose in scene.object_poses()] == list(task.object_names)
    assert set(task.yaw_symmetry_deg) <= set(task.object_names)


@every_task
def test_variations_take_turns_with_the_seed(name):
    variations = ALL_TASKS[name].variations
    assert [scene_of(name, seed).variation for seed in range(variations)] == list(range(variations))


@every_task
def test_an_unknown_variation_is_refused(name):
    with pytest.raises(InvalidInputError, match="variation"):
        make_task(name, 0, ALL_TASKS[name].variations + ALL_TASKS[name].test_only_variations)


@every_task
def test_objects_move_and_turn_from_seed_to_seed(name):
    scenes = [scene_of(name, seed) for seed in range(8)]
    positions = np.array([[pose.position_m for pose in scene.object_poses()] for scene in scenes])
    assert (positions[..., :2].std(axis=0) > MIN_SPREAD_M).all()
    for object_name in ALL_TASKS[name].object_names:
        if ALL_TASKS[name].yaw_symmetry_deg.get(object_name) != 0:
            assert np.std([scene.yaw_rad(object_name) for scene in scenes]) > MIN_SPREAD_RAD


@every_task
def test_things_rest_before_the_arm_moves(name):
    scene = scene_of(name, 2)
    assert np.abs(scene.data.qvel).max() < 0.01
    assert not scene.succeeded()


@every_task
@pytest.mark.parametrize("seed", [0, ONE_MORE, *LATER])
def test_the_front_camera_sees_every_object(name, seed):
    front, mask_ids = front_of(name, seed)
    for object_name, ids in mask_ids.items():
        assert np.isin(front.mask, ids).sum() > MIN_PIXELS, object_name


@every_expert
@pytest.mark.parametrize("seed", [0, ONE_MORE, *LATER])
def test_the_expert_and_its_binned_keyframes_succeed(name, seed):
    demonstration = record_demonstration(name, seed, cameras=())
    assert demonstration.succeeded, demonstration.failure
    keyframes = merged(Motion.of(demonstration.trajectory))
    assert len(keyframes) == len(demonstration.expert_actions)
    assert 3 <= len(keyframes) <= (MAX_KEYFRAMES if name in TASKS else MAX_OF_COMPOSITIONS)
    binned = discretize_actions([demonstration.trajectory.action_at(frame) for frame in keyframes], WORKSPACE)
    assert not any(action.clamped for action in binned)
    result = rollout(name, seed, undiscretize_actions([action.bins for action in binned], WORKSPACE))
    assert result.succeeded, result.failure


@pytest.mark.parametrize("name", [name for name, task in TASKS.items() if task.ways > 1])
def test_ways_differ_and_the_first_is_the_default(name):
    task, plans = make_task(name, 0), []
    assert (task.way, task.ways) == (0, 2)
    for way in range(task.ways):
        task.way = way
        poses = [move.pose for move in task.expert()]
        plans.append(np.array([[*pose.position_m, *pose.rotation.as_rotvec()] for pose in poses]))
    assert np.abs(plans[0] - plans[1]).max() > 0.03
