import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.perception.models import model_from_json
from app.perception.points import MAX_POINTS, object_points
from roboprompt_client.camera import Camera, RgbdFrame
from roboprompt_client.trajectory import ObjectPose

AT_M = np.array([0.2, 0.1, 0.8])
QUARTER_XYZW = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
POSE = ObjectPose("cube", AT_M, QUARTER_XYZW)
MASK_ID = 7


def frame(rows):
    """A camera 1 m above the workspace's floor that looks down; the object fills the first rows of 8 pixels."""
    camera = Camera("front", 100.0, 100.0, 3.5, 3.5, np.diag([1.0, -1.0, -1.0, 1.0]))
    mask = np.zeros((8, 8), np.int32)
    mask[:rows] = MASK_ID
    return RgbdFrame(camera, depth_m=np.full((8, 8), 0.5, np.float32), mask=mask)


def test_masked_pixels_with_depth_are_the_points():
    points_m, source = object_points(ObjectQuery("cube", mask_ids=(MASK_ID,)), POSE, [frame(3), frame(3)])
    assert source == "images"
    assert points_m.shape == (2 * 3 * 8, 3)
    np.testing.assert_allclose(points_m[:, 2], -0.5)


def test_a_few_pixels_say_less_than_the_pose():
    _, source = object_points(ObjectQuery("cube", mask_ids=(MASK_ID,)), POSE, [frame(2)])
    assert source == "assumed"


def extent_m(points_m):
    return points_m.min(axis=0), points_m.max(axis=0)


def test_a_cuboid_of_known_size_stands_at_its_pose():
    model = {"estimator": "cuboid", "size_m": [0.06, 0.02, 0.1], "color": "red", "origin_m": [0, 0, 0.05]}
    query = ObjectQuery("cube", tuple(AT_M), model=model_from_json("cube", model))
    points_m, source = object_points(query, POSE, [])
    low, high = extent_m(points_m)
    assert source == "model"
    np.testing.assert_allclose(high - low, [0.02, 0.06, 0.1], atol=1e-9)  # a quarter turn
    np.testing.assert_allclose((low + high) / 2, AT_M - [0, 0, 0.05], atol=1e-9)


def test_a_large_cuboid_has_a_bounded_number_of_points():
    model = {"estimator": "cuboid", "size_m": [3.0, 3.0, 3.0], "color": "red"}
    points_m, _ = object_points(ObjectQuery("cube", model=model_from_json("cube", model)), POSE, [])
    assert len(points_m) < 2 * MAX_POINTS


def test_of_anything_else_a_ball_is_assumed():
    points_m, source = object_points(ObjectQuery("cube", tuple(AT_M)), ObjectPose("cube", AT_M), [])
    low, high = extent_m(points_m)
    assert source == "assumed"
    np.testing.assert_allclose(high - AT_M, AT_M - low)
    assert np.linalg.norm(points_m - AT_M, axis=1).max() == pytest.approx(0.025, abs=1e-3)
