"""What rotations must satisfy, and the same numbers as scipy's Rotation up to rounding."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from roboprompt_client.types import quaternions as rotations

ROTATIONS = Rotation.random(200, rng=np.random.default_rng(1))
PAIRS = list(pairwise(ROTATIONS))


def test_known_turns():
    quarter = rotations.about_z(math.pi / 2)
    np.testing.assert_allclose(rotations.rotated(quarter, [1, 0, 0]), [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(rotations.to_rotation_vector(quarter), [0, 0, math.pi / 2])
    assert rotations.yaw_rad(quarter) == pytest.approx(math.pi / 2)
    assert rotations.tilt_rad([1.0, 0, 0, 0]) == pytest.approx(math.pi)  # the gripper points down
    assert rotations.angle_rad(-quarter) == pytest.approx(math.pi / 2)
    leaning = Rotation.from_euler("yz", [30, -20], degrees=True).as_quat()
    assert math.degrees(rotations.yaw_rad(leaning)) == pytest.approx(-20)
    assert math.degrees(rotations.tilt_rad(leaning)) == pytest.approx(30)


def test_a_hardly_turned_frame_keeps_its_turn():
    vector = np.array([3e-9, 0, 0])
    np.testing.assert_allclose(rotations.to_rotation_vector(rotations.from_rotation_vector(vector)), vector)


def test_products_and_turned_vectors():
    for one, other in PAIRS:
        expected = (one * other).as_quat(canonical=True)
        mine = rotations.canonical(rotations.product(one.as_quat(), other.as_quat()))
        np.testing.assert_allclose(mine, expected, atol=1e-12)
        np.testing.assert_allclose(rotations.rotated(one.as_quat(), [1, 2, 3]), one.apply([1, 2, 3]), atol=1e-12)
        assert rotations.angle_rad(one.as_quat()) == pytest.approx(one.magnitude(), abs=1e-12)


def test_other_forms():
    for one, _ in PAIRS:
        q = one.as_quat()
        np.testing.assert_allclose(rotations.to_matrix(q), one.as_matrix(), atol=1e-12)
        np.testing.assert_allclose(rotations.from_matrix(one.as_matrix()), one.as_quat(canonical=True), atol=1e-9)
        np.testing.assert_allclose(rotations.to_rotation_vector(q), one.as_rotvec(), atol=1e-9)


@pytest.mark.parametrize("quaternion", [[0, 0, -1.0, 0], [-1.0, 0, 0, 0], [-0.6, 0.8, 0, 0], [0.5, 0.5, 0.5, -0.5]])
def test_of_two_equal_quaternions_the_same(quaternion):
    expected = Rotation.from_quat(quaternion).as_quat(canonical=True)
    np.testing.assert_allclose(rotations.canonical(quaternion), expected, atol=1e-15)
