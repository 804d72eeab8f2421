import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery
from app.perception.given import GivenPoses
from app.perception.noise import NoisyPoses
from app.pipeline.errors import InvalidInputError
from app.pipeline.noise import MEAN_ERROR_M, MEAN_ERROR_RAD

TURN = Rotation.from_euler("xyz", [0.2, -0.4, 1.0])


def query(name="cube", x_m=0.2):
    return ObjectQuery(name, (x_m, -0.1, 0.8), tuple(TURN.as_quat()))


def test_errors_have_the_papers_average_sizes():
    shifts_m, turns_rad = [], []
    for x_m in np.linspace(0, 1, 1000):
        (pose,) = NoisyPoses(GivenPoses()).estimate([query(x_m=float(x_m))], [])
        shifts_m.append(np.linalg.norm(pose.position_m - [x_m, -0.1, 0.8]))
        turns_rad.append((Rotation.from_quat(pose.quaternion_xyzw) * TURN.inv()).magnitude())
    assert np.mean(shifts_m) == pytest.approx(MEAN_ERROR_M, rel=0.05)
    assert np.mean(turns_rad) == pytest.approx(MEAN_ERROR_RAD, rel=0.05)


def test_a_scene_is_disturbed_alike_every_time_and_other_scenes_and_seeds_differently():
    estimator = NoisyPoses(GivenPoses())
    first, second = (estimator.estimate([query()], [])[0].position_m for _ in range(2))
    np.testing.assert_array_equal(first, second)
    other_seed = NoisyPoses(GivenPoses(), seed=1).estimate([query()], [])[0].position_m
    other_scene = estimator.estimate([query(x_m=0.3)], [])[0].position_m - [0.1, 0, 0]
    assert not np.allclose(first, other_seed)
    assert not np.allclose(first, other_scene)


def test_names_estimators_and_missing_rotations_stay():
    one, other = NoisyPoses(GivenPoses()).estimate([query(), ObjectQuery("plate", (0, 0, 1))], [])
    assert (one.name, one.estimator, other.name, other.quaternion_xyzw) == ("cube", "given", "plate", None)
    assert not np.allclose(one.position_m - [0.2, -0.1, 0.8], other.position_m - [0, 0, 1])


def test_a_negative_error_is_refused():
    with pytest.raises(InvalidInputError) as caught:
        NoisyPoses(GivenPoses(), mean_error_m=-0.01)
    assert caught.value.field == "mean_error_m"
