import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.pipeline.noise import MEAN_ERROR_M, MEAN_ERROR_RAD, disturbed
from roboprompt_client.types.poses import ObjectPose

PLACE_M = np.array([0.2, -0.1, 0.8])
TURN = Rotation.from_euler("xyz", [0.2, -0.4, 1.0])
CUBE = ObjectPose("cube", PLACE_M, TURN.as_quat(), estimator="given")
PLATE = ObjectPose("plate", PLACE_M, None, estimator="given")


def papers(poses, seed=0):
    random = np.random.default_rng(seed)
    return disturbed(poses, random, mean_error_m=MEAN_ERROR_M, mean_error_rad=MEAN_ERROR_RAD)


def test_errors_have_the_papers_average_sizes():
    poses = papers([CUBE] * 1000)
    turns = [Rotation.from_quat(pose.quaternion_xyzw) * TURN.inv() for pose in poses]
    assert np.mean([np.linalg.norm(pose.position_m - PLACE_M) for pose in poses]) == pytest.approx(
        MEAN_ERROR_M, rel=0.05
    )
    assert np.mean([turn.magnitude() for turn in turns]) == pytest.approx(MEAN_ERROR_RAD, rel=0.05)


def test_names_estimators_and_missing_rotations_stay_and_each_object_has_an_error_of_its_own():
    cube, plate = papers([CUBE, PLATE])
    assert (cube.name, cube.estimator, plate.name, plate.quaternion_xyzw) == ("cube", "given", "plate", None)
    assert not np.allclose(cube.position_m, plate.position_m)


def test_the_same_draws_give_the_same_errors_and_others_give_others():
    (first,), (again,), (other,) = papers([CUBE]), papers([CUBE]), papers([CUBE], seed=1)
    np.testing.assert_array_equal(first.position_m, again.position_m)
    assert not np.allclose(first.position_m, other.position_m)
