import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.skill import turns

A, B = Rotation.random(50, rng=1), Rotation.random(50, rng=2)
VECTORS = np.random.default_rng(3).normal(size=(50, 3))


def test_products_and_rotations_are_scipys():
    same = turns.product(A.as_quat(), B.as_quat())
    assert turns.angle(same, (A * B).as_quat()).max() < 1e-6
    np.testing.assert_allclose(turns.rotated(A.as_quat(), VECTORS), A.apply(VECTORS), atol=1e-12)


def test_exp_is_the_inverse_of_log():
    np.testing.assert_allclose(turns.log(A.as_quat()), A.as_rotvec(), atol=1e-9)
    assert turns.angle(turns.exp(turns.log(A.as_quat())), A.as_quat()).max() < 1e-6
    np.testing.assert_allclose(turns.log(turns.exp(np.zeros(3))), np.zeros(3))


def test_a_yaw_is_that_of_the_x_axis():
    x_axes = A.apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(turns.yaw(A.as_quat()), np.arctan2(x_axes[:, 1], x_axes[:, 0]), atol=1e-9)


def test_a_medoid_is_one_of_the_crowd():
    crowd = turns.product(turns.exp(0.01 * VECTORS[:7]), A[0].as_quat())
    found = turns.medoid(np.concatenate([crowd, B[:2].as_quat()]))
    assert turns.angle(found, A[0].as_quat()) < 0.05


def test_angles_are_wrapped():
    np.testing.assert_allclose(turns.wrapped([3 * np.pi / 2, -3 * np.pi / 2, 0.3]), [-np.pi / 2, np.pi / 2, 0.3])
