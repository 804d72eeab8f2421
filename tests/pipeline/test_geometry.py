import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.pipeline.geometry import backproject, canonical_pose, transform_points
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.quaternions import yaw_rad

from .scenes import angle_deg, pose, positions, rotated, rotations


def rigid(rotation, translation_m):
    transform = np.eye(4)
    transform[:3, :3] = rotation.as_matrix()
    transform[:3, 3] = translation_m
    return transform


def pixel(row, column, shape=(4, 6)):
    pixels = np.zeros(shape, bool)
    pixels[row, column] = True
    return pixels


def test_pixels_of_unknown_depth_are_left_out():
    depth_m = np.full((4, 6), 2, np.float32)
    depth_m[0] = 0
    depth_m[1] = math.nan
    frame = RgbdFrame(Camera("top", 100, 100, 2.5, 1.5, np.eye(4)), depth_m=depth_m)
    assert len(backproject(frame, np.ones((4, 6), bool))) == 12
    assert backproject(frame, pixel(0, 3)).shape == (0, 3)


def test_back_projection_needs_depth():
    with pytest.raises(InvalidInputError) as caught:
        backproject(RgbdFrame(Camera("top", 1, 1, 0, 0, np.eye(4))), pixel(0, 0))
    assert caught.value.field == "depth_top"


@given(
    rotation=rotations(),
    origin_m=positions((-2, -2, -2), (2, 2, 2)),
    intrinsics=st.tuples(st.floats(20, 900), st.floats(20, 900), st.floats(2, 4), st.floats(1, 3)),
    seen=st.tuples(st.integers(0, 3), st.integers(0, 5), st.floats(0.125, 5, width=32)),
)
def test_projecting_a_back_projected_pixel_gives_the_pixel(rotation, origin_m, intrinsics, seen):
    fx, fy, cx, cy = intrinsics
    row, column, depth = seen
    camera_to_world = rigid(rotation, origin_m)
    frame = RgbdFrame(
        Camera("any", fx, fy, cx, cy, camera_to_world, image_size_px=(6, 4)),
        depth_m=np.full((4, 6), depth, np.float32),
    )
    (point,) = backproject(frame, pixel(row, column))
    projection = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]) @ np.linalg.inv(camera_to_world)[:3]
    u_z, v_z, z = projection @ [*point, 1]
    np.testing.assert_allclose([u_z / z, v_z / z, z], [column, row, depth], atol=1e-6)


def test_transform_points_turns_then_moves():
    quarter = rigid(rotated(0, 0, 90), (10, 0, 1))
    np.testing.assert_allclose(transform_points(quarter, np.array([[1.0, 2, 3], [0, 0, 0]])), [[8, 1, 4], [10, 0, 1]])


@pytest.mark.parametrize(
    ("symmetry_deg", "yaws_deg", "expected_deg"),
    [
        (90, (10, 100, 190, -80, -170), 10),
        (90, (-44, 46, 136), -44),
        (90, (45, -45, 135, -135, 225), -45),
        (180, (80, 260, -100), 80),
        (180, (90, -90, 270), -90),
        (120, (50, 170, -70), 50),
        (0, (0, 13, 90, -179, 180), 0),
        (360, (170, -190), 170),
        (None, (170, -190), 170),
    ],
)
def test_equal_scenes_give_equal_poses(symmetry_deg, yaws_deg, expected_deg):
    for yaw_deg in yaws_deg:
        canonical = canonical_pose(pose("cube", (0.1, 0.2, 0.7), yaw_deg), symmetry_deg)
        assert angle_deg(canonical.quaternion_xyzw, rotated(0, 0, expected_deg).as_quat()) < 1e-5
        np.testing.assert_array_equal(canonical.position_m, [0.1, 0.2, 0.7])
        assert canonical.name == "cube"


@given(rotations(), st.sampled_from([90, 120, 180]), st.integers(0, 3))
def test_equal_scenes_give_equal_poses_however_the_object_lies(rotation, symmetry_deg, turns):
    turned = rotation * rotated(0, 0, symmetry_deg * turns)
    first, second = (canonical_pose(pose("block", (0, 0, 0), r), symmetry_deg) for r in (rotation, turned))
    assert angle_deg(first.quaternion_xyzw, second.quaternion_xyzw) < 1e-4


@given(rotations(), st.floats(-180, 180))
def test_a_round_object_has_one_pose_however_it_lies(rotation, turn_deg):
    first, second = (
        canonical_pose(pose("cup", (0, 0, 0), r), 0) for r in (rotation, rotation * rotated(0, 0, turn_deg))
    )
    assert angle_deg(first.quaternion_xyzw, second.quaternion_xyzw) < 1e-4
    assert yaw_rad(first.quaternion_xyzw) == pytest.approx(0, abs=1e-6)


@given(rotations(), st.sampled_from([0, 90, 180, 360]))
def test_the_canonical_pose_shows_the_object_the_same_way_up(rotation, symmetry_deg):
    canonical = Rotation.from_quat(canonical_pose(pose("block", (0, 0, 0), rotation), symmetry_deg).quaternion_xyzw)
    np.testing.assert_allclose(canonical.apply([0, 0, 1]), rotation.apply([0, 0, 1]), atol=1e-9)


def test_a_pose_without_rotation_or_symmetry_is_left_alone():
    unrotated, asymmetric = pose("cube", (0, 0, 1)), pose("mug", (0, 0, 1), 170)
    assert canonical_pose(unrotated, 90) is unrotated
    assert canonical_pose(asymmetric, None) is asymmetric
