import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.evaluation.report.drawing import (
    ACTION_COLOUR,
    AXIS_COLOURS,
    AXIS_LENGTH_M,
    Label,
    draw_labels,
    draw_scene,
    project,
)
from app.pipeline.geometry import backproject
from app.sim.world import calibrated
from roboprompt_client.camera import Camera, RgbdFrame
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

CAMERA = calibrated("front")
GREY = np.full((480, 640, 3), 128, np.uint8)
LEVEL = [0.0, 0.0, 0.0, 1.0]
CUBE = ObjectPose("cube", [0.1, 0.2, 0.8], Rotation.from_euler("z", 30, degrees=True).as_quat())
# 2 m in front of the camera, half a metre right and a quarter down
BEFORE = Camera("before", 100.0, 200.0, 320.0, 240.0, np.eye(4))


def changed(image):
    """Boxes as (left, top, right, bottom) of what was drawn."""
    rows, columns = np.nonzero((image != GREY).any(axis=2))
    return columns.min(), rows.min(), columns.max(), rows.max()


def near(image, pixel, colour, radius_px=3):
    """Whether a pixel of about that colour lies near `pixel`."""
    u, v = np.rint(pixel).astype(int)
    patch = image[v - radius_px : v + radius_px + 1, u - radius_px : u + radius_px + 1].astype(int)
    return bool((np.abs(patch - colour).max(axis=2) < 40).any())


def test_projection_by_hand():
    np.testing.assert_allclose(project(BEFORE, np.array([[0.5, 0.25, 2.0]])), [[345.0, 265.0]])
    assert np.isnan(project(BEFORE, np.array([[0.5, 0.25, -2.0]]))).all()


def test_projection_undoes_backprojection():
    depth_m = np.zeros((480, 640), np.float32)
    depth_m[123, 456] = 1.5
    point = backproject(RgbdFrame(CAMERA, depth_m=depth_m), depth_m > 0)
    np.testing.assert_allclose(project(CAMERA, point), [[456, 123]], atol=1e-6)


def test_axes_are_drawn_where_they_project_to():
    image = draw_scene(GREY, CAMERA, [CUBE])
    rotation = Rotation.from_quat(CUBE.quaternion_xyzw)
    for axis, colour in zip(np.eye(3), AXIS_COLOURS, strict=True):
        along = CUBE.position_m + rotation.apply(axis) * AXIS_LENGTH_M * 0.9
        assert near(image, project(CAMERA, along[None])[0], colour)
        beyond = CUBE.position_m - rotation.apply(axis) * AXIS_LENGTH_M
        assert not near(image, project(CAMERA, beyond[None])[0], colour)


def test_the_image_itself_stays():
    image = GREY.copy()
    draw_scene(image, CAMERA, [CUBE], [EndEffectorAction([0.1, 0.2, 0.9], LEVEL, True)])
    np.testing.assert_array_equal(image, GREY)


def test_an_object_without_rotation_is_a_dot():
    dot = draw_scene(GREY, CAMERA, [ObjectPose("cube", CUBE.position_m)])
    for colour in AXIS_COLOURS:
        assert (np.abs(dot.astype(int) - colour).max(axis=2) > 40).all()
    left, top, _, bottom = changed(dot)
    u, v = project(CAMERA, CUBE.position_m[None])[0]
    assert left <= u <= left + 10
    assert top <= v <= bottom


def test_actions_are_a_path_of_dots_that_are_hollow_where_the_gripper_is_open():
    positions = np.array([[0.1, 0.3, 1.0], [0.3, -0.1, 1.1]])
    actions = [EndEffectorAction(positions[0], LEVEL, True), EndEffectorAction(positions[1], LEVEL, False)]
    image = draw_scene(GREY, CAMERA, [], actions)
    opened, closed = project(CAMERA, positions)
    assert near(image, opened, (255, 255, 255), 0)
    assert near(image, closed, ACTION_COLOUR, 0)
    assert near(image, (opened + closed) / 2, ACTION_COLOUR, 1)


def test_what_is_behind_the_camera_is_not_drawn():
    behind = CAMERA.camera_to_world[:3, 3] - CAMERA.camera_to_world[:3, 2]
    action = EndEffectorAction(behind, LEVEL, True)
    np.testing.assert_array_equal(draw_scene(GREY, CAMERA, [ObjectPose("cube", behind, LEVEL)], [action]), GREY)


@pytest.mark.parametrize("point_px", [(320, 240), (-50, -50), (700, 500), (639, 0)])
def test_labels_stay_in_the_image_and_apart(point_px):
    labels = [Label("first button", point_px), Label("second button", point_px)]
    one, both = (draw_labels(GREY, labels[:number]) for number in (1, 2))
    first = (one != GREY).any(axis=2)
    second = (both != one).any(axis=2)
    assert first.sum() > 500
    assert second.sum() > 500
    assert not (first & second).any()
    assert not first[[0, -1]].any()
    assert not first[:, [0, -1]].any()
