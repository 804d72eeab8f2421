"""Scenes that somebody changes: objects lie elsewhere, at rest, and the same seed changes them in the same way."""

import numpy as np
import pytest

from app.sim.shift import can_shift, free_objects, shift_free_objects
from app.sim.tasks import make_task
from roboprompt_client.errors import InvalidInputError

SHIFT_M = 0.03


def places(task):
    return {pose.name: pose.position_m for pose in task.object_poses()}


@pytest.mark.parametrize("name", ["stack_cube", "put_in_drawer", "stack_cups"])
def test_free_objects_move_by_the_distance_and_the_rest_stays(name):
    task = make_task(name, 100_000)
    before = places(task)
    moved = shift_free_objects(task, SHIFT_M, 1)
    assert moved == free_objects(task)
    for object_name, place_m in places(task).items():
        expected_m = SHIFT_M if object_name in moved else 0.0
        assert np.linalg.norm(place_m - before[object_name]) == pytest.approx(expected_m, abs=0.005)
        assert place_m[2] == pytest.approx(before[object_name][2], abs=0.002)


def test_a_stack_moves_as_one():
    task = make_task("destack_cube", 100_000)
    blue_m, yellow_m = places(task).values()
    shift_free_objects(task, SHIFT_M, 1)
    blue, yellow = places(task).values()
    np.testing.assert_allclose(blue - blue_m, yellow - yellow_m, atol=0.002)


def test_the_seed_decides():
    scenes = [make_task("stack_cube", 100_000) for _ in range(3)]
    for scene, seed in zip(scenes, (1, 1, 2), strict=True):
        shift_free_objects(scene, SHIFT_M, seed)
    first, same, other = (np.stack(list(places(scene).values())) for scene in scenes)
    np.testing.assert_array_equal(first, same)
    assert np.abs(first - other).max() > 0.005


@pytest.mark.parametrize(("name", "said"), [("push_button", "no free object"), ("unplug_cable", "no room")])
def test_scenes_without_free_objects_or_room(name, said):
    task = make_task(name, 100_000)
    before = places(task)
    with pytest.raises(InvalidInputError, match=said):
        shift_free_objects(task, SHIFT_M, 1)
    assert not can_shift(name, SHIFT_M)
    for object_name, place_m in places(task).items():
        np.testing.assert_array_equal(place_m, before[object_name])
