"""The same numbers as scipy's Rotation, up to rounding."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from roboprompt_client import quaternions as rotations

ROTATIONS = Rotation.random(200, rng=np.random.default_rng(1))
PAIRS = list(pairwise(ROTATIONS))


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
        np.testing.assert_allclose(rotations.to_roll_pitch_yaw(q), one.as_euler("xyz"), atol=1e-9)


@pytest.mark.parametrize("quaternion", [[0, 0, -1.0, 0], [-1.0, 0, 0, 0], [-0.6, 0.8, 0, 0], [0.5, 0.5, 0.5, -0.5]])
def test_of_two_equal_quaternions_the_same(quaternion):
    expected = Rotation.from_quat(quaternion).as_quat(canonical=True)
    np.testing.assert_allclose(rotations.canonical(quaternion), expected, atol=1e-15)
