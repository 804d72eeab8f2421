import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.drawing import AXIS_COLORS, AXIS_M, Canvas
from app.evaluation.report.pictures import ACTION_COLOR, draw_scene
from app.pipeline.geometry import backproject
from app.sim.world import calibrated
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

CAMERA = calibrated("front")
GREY = np.full((480, 640, 3), 128, np.uint8)
LEVEL = [0.0, 0.0, 0.0, 1.0]
CUBE = ObjectPose("cube", [0.1, 0.2, 0.8], Rotation.from_euler("z", 30, degrees=True).as_quat())


def changed(image):
    """Boxes as (left, top, right, bottom) of what was drawn."""
    rows, columns = np.nonzero((image != GREY).any(axis=2))
    return columns.min(), rows.min(), columns.max(), rows.max()


def near(image, pixel, color, radius_px=3):
    """Whether a pixel of about that color lies near `pixel`."""
    u, v = np.rint(pixel).astype(int)
    patch = image[v - radius_px : v + radius_px + 1, u - radius_px : u + radius_px + 1].astype(int)
    return bool((np.abs(patch - color).max(axis=2) < 40).any())


def test_axes_are_drawn_where_they_project_to():
    image = draw_scene(GREY, CAMERA, [CUBE])
    rotation = Rotation.from_quat(CUBE.quaternion_xyzw)
    for axis, color in zip(np.eye(3), AXIS_COLORS, strict=True):
        along = CUBE.position_m + rotation.apply(axis) * AXIS_M * 0.9
        assert near(image, CAMERA.project(along)[0], color)
        beyond = CUBE.position_m - rotation.apply(axis) * AXIS_M
        assert not near(image, CAMERA.project(beyond)[0], color)


def test_the_image_itself_stays():
    image = GREY.copy()
    draw_scene(image, CAMERA, [CUBE], [EndEffectorAction([0.1, 0.2, 0.9], LEVEL, True)])
    np.testing.assert_array_equal(image, GREY)


def test_an_object_without_rotation_is_a_dot():
    dot = draw_scene(GREY, CAMERA, [ObjectPose("cube", CUBE.position_m)])
    for color in AXIS_COLORS:
        assert (np.abs(dot.astype(int) - color).max(axis=2) > 40).all()
    left, top, _, bottom = changed(dot)
    u, v = CAMERA.project(CUBE.position_m)[0]
    assert left <= u <= left + 10
    assert top <= v <= bottom


def test_actions_are_a_path_of_dots_that_are_hollow_where_the_gripper_is_open():
    positions = np.array([[0.1, 0.3, 1.0], [0.3, -0.1, 1.1]])
    actions = [EndEffectorAction(positions[0], LEVEL, True), EndEffectorAction(positions[1], LEVEL, False)]
    image = draw_scene(GREY, CAMERA, [], actions)
    opened, closed = CAMERA.project(positions)[0]
    assert near(image, opened, (255, 255, 255), 0)
    assert near(image, closed, ACTION_COLOR, 0)
    assert near(image, (opened + closed) / 2, ACTION_COLOR, 1)


def test_what_is_behind_the_camera_is_not_drawn():
    behind = CAMERA.camera_to_world[:3, 3] - CAMERA.camera_to_world[:3, 2]
    action = EndEffectorAction(behind, LEVEL, True)
    np.testing.assert_array_equal(draw_scene(GREY, CAMERA, [ObjectPose("cube", behind, LEVEL)], [action]), GREY)


@pytest.mark.parametrize("pixel", [(320, 240), (1, 1), (1, 478), (638, 1), (638, 478)])
def test_names_stay_in_the_image_and_apart(pixel):
    depth_m = np.zeros((480, 640), np.float32)
    depth_m[pixel[1], pixel[0]] = 1.0
    (point_m,) = backproject(RgbdFrame(CAMERA, depth_m=depth_m), depth_m > 0)
    canvas = Canvas(CAMERA, GREY.copy())
    assert canvas.name("first button", point_m, ACTION_COLOR)
    first = (canvas.image != GREY).any(axis=2)
    one = canvas.image.copy()
    assert canvas.name("second button", point_m, ACTION_COLOR)
    second = (canvas.image != one).any(axis=2)
    assert first.sum() > 500
    assert second.sum() > 500
    assert not (first & second).any()
