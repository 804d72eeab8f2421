"""What rotations must satisfy, whatever library is at hand."""

import math
from itertools import pairwise

import numpy as np
import pytest

from roboprompt_client import quaternions as rotations

RANDOM = np.random.default_rng(0)
SOME = [q / np.linalg.norm(q) for q in RANDOM.normal(size=(20, 4))]
HALF_TURNS = [[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0.6, 0.8, 0, 0]]


def same(one, other):
    return rotations.angle_rad(rotations.product(one, rotations.inverse(other))) < 1e-7


@pytest.mark.parametrize("q", [*SOME, *HALF_TURNS, rotations.IDENTITY])
def test_there_and_back(q):
    assert same(rotations.product(q, rotations.inverse(q)), rotations.IDENTITY)
    assert same(rotations.from_rotation_vector(rotations.to_rotation_vector(q)), q)
    assert same(rotations.from_matrix(rotations.to_matrix(q)), q)
    assert same(rotations.from_roll_pitch_yaw(*rotations.to_roll_pitch_yaw(q)), q)
    assert same(rotations.canonical(-np.asarray(q)), q)


@pytest.mark.parametrize("pitch_rad", [math.pi / 2, -math.pi / 2])
def test_a_pitch_of_90_degrees_is_some_rotation_that_comes_back(pitch_rad):
    q = rotations.from_roll_pitch_yaw(0.3, pitch_rad, -1.1)
    assert same(rotations.from_roll_pitch_yaw(*rotations.to_roll_pitch_yaw(q)), q)


def test_a_product_turns_by_the_second_and_then_by_the_first():
    vector = RANDOM.normal(size=3)
    for after, first in pairwise(SOME):
        both = rotations.rotated(rotations.product(after, first), vector)
        np.testing.assert_allclose(both, rotations.rotated(after, rotations.rotated(first, vector)), atol=1e-12)


def test_known_turns():
    quarter = rotations.about_z(math.pi / 2)
    np.testing.assert_allclose(rotations.rotated(quarter, [1, 0, 0]), [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(rotations.to_rotation_vector(quarter), [0, 0, math.pi / 2])
    assert rotations.yaw_rad(quarter) == pytest.approx(math.pi / 2)
    assert rotations.tilt_rad([1.0, 0, 0, 0]) == pytest.approx(math.pi)  # the gripper points down
    assert rotations.angle_rad(-quarter) == pytest.approx(math.pi / 2)


def test_a_hardly_turned_frame_keeps_its_turn():
    vector = np.array([3e-9, 0, 0])
    np.testing.assert_allclose(rotations.to_rotation_vector(rotations.from_rotation_vector(vector)), vector)
