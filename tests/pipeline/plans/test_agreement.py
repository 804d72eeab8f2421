from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.plans.agreement import agreed
from app.pipeline.plans.rows import plan_rows
from app.pipeline.representation.anchors import START

from ..scenes import action, angle_deg, same_actions
from .taught import reached, scene

OFFSET_M = np.array([0.02, -0.01, 0.11])


def scattered(random, number, sigma_m=0.01):
    return OFFSET_M + random.normal(0, sigma_m, (number, 3))


def offsets_m(group):
    """Of the first action from the cube."""
    return np.array([d.actions[0].position_m - d.objects[0].position_m for d in group])


def agrees(group):
    """Whether `agreed` shows one offset in all."""
    shown_m = offsets_m(agreed(group))
    return bool(np.ptp(shown_m, axis=0).max() < 1e-9)


def error_m(seed, number):
    """How far the shown value is from the true one."""
    random = np.random.default_rng(seed)
    group = reached(scattered(random, number), random=random)
    shown_m = offsets_m(agreed(group))
    assert np.ptp(shown_m, axis=0).max() < 1e-9
    return float(np.linalg.norm(shown_m[0] - OFFSET_M))


def test_scatter_around_one_value_is_shown_as_one_near_to_the_true_one():
    """Noise shrinks with the square root of the number: a quarter from 4 to 64."""
    few, many = (np.mean([error_m(seed, number) for seed in range(30)]) for number in (4, 64))
    assert 3 < few / many < 5.5
    assert many < 0.003


@pytest.mark.parametrize("apart_m", [0.06])
@pytest.mark.parametrize("shares", [(4, 4), (7, 3)])
def test_two_ways_are_never_averaged(apart_m, shares):
    random = np.random.default_rng(7)
    own_m = scattered(random, sum(shares), sigma_m=0.004)
    own_m[shares[0] :, 1] += apart_m
    group = reached(own_m, random=random)
    for before, after in zip(group, agreed(group), strict=True):
        assert same_actions(before.actions, after.actions)


def test_a_row_half_way_between_two_objects_stays_as_it_was_shown():
    random = np.random.default_rng(3)
    seen = [scene(random) for _ in range(10)]
    between_m = [(plate.position_m - cube.position_m) / 2 + random.normal(0, 0.003, 3) for cube, plate in seen]
    group = reached(between_m, random=random, objects=seen)
    for before, after in zip(group, agreed(group), strict=True):
        assert same_actions(before.actions, after.actions)


def test_turns_across_half_a_circle_are_averaged_the_short_way():
    random = np.random.default_rng(6)
    group = agreed(reached([OFFSET_M] * 6, random=random, turns_deg=[175, -175, 178, -178, 180, -180]))
    true_xyzw = action((0, 0, 0), (180, 0, 180)).quaternion_xyzw
    for demonstration in group:
        assert angle_deg(demonstration.actions[0].quaternion_xyzw, true_xyzw) < 2


def test_a_single_demonstration_is_shown_as_it_is():
    group = reached([OFFSET_M], random=np.random.default_rng(9))
    assert agreed(group) == tuple(group)


@pytest.mark.parametrize("odd_m", [0.05, 0.08, 0.3])
@pytest.mark.parametrize("seed", range(2))
def test_one_odd_demonstration_out_of_ten_hardly_moves_the_center(odd_m, seed):
    random = np.random.default_rng(seed)
    own_m = scattered(random, 10, sigma_m=0.003)
    without_m = offsets_m(agreed(reached(own_m, random=random)))[0]
    own_m[4, 0] = OFFSET_M[0] + odd_m
    group = reached(own_m, random=random)
    assert agrees(group)
    assert np.linalg.norm(offsets_m(agreed(group))[0] - without_m) < 0.004


def started(group, starts_m):
    return [replace(d, start=action(start_m)) for d, start_m in zip(group, starts_m, strict=True)]


def test_a_row_that_goes_on_from_the_start_is_relative_to_it():
    random = np.random.default_rng(11)
    seen = [scene(random) for _ in range(6)]
    starts_m = random.uniform([-0.2, -0.3, 1.0], [0.4, 0.3, 1.2], (6, 3))
    raised_m = [
        np.add(start_m, [0, 0, 0.1]) - cube.position_m for start_m, (cube, _) in zip(starts_m, seen, strict=True)
    ]
    group = started(reached(raised_m, random=random, objects=seen), starts_m)
    (row,) = plan_rows(group)
    assert set(row.anchors) == {START}
    np.testing.assert_allclose(row.center_m, [0, 0, 0.1], atol=1e-9)
