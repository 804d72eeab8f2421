import numpy as np
import pytest

from app.perception.overlay import AXIS_COLORS, PALETTE, draw_overlay
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.poses import ObjectPose

HEIGHT, WIDTH = 240, 320
GREY = 200
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
COLOR = np.array(PALETTE[0])


def frame():
    """A camera 1 m above the origin that looks down, the world's x to the right, its y up in the image."""
    pose = np.eye(4)
    pose[:3, :3] = np.diag([1, -1, -1])
    pose[2, 3] = 1
    grey = np.full((HEIGHT, WIDTH, 3), GREY, np.uint8)
    return RgbdFrame(Camera("top", 400, 400, 160, 120, pose), grey)


def changed(image):
    """The pixels that differ from the plain image."""
    return (image != GREY).any(axis=2)


def near(image, row, column, color, within=45):
    """Whether some pixel around a place has nearly that color."""
    patch = image[row - 2 : row + 3, column - 2 : column + 3].astype(int)
    return bool((np.abs(patch - np.array(color)).max(axis=2) <= within).any())


def test_axes_point_as_the_object_lies():
    turned = ObjectPose("cube", np.zeros(3), np.array([0, 0, np.sqrt(0.5), np.sqrt(0.5)]))
    image = draw_overlay(frame(), [turned])
    # an axis of 5 cm is 20 px long; x now points up in the image, y to the left
    assert near(image, 120 - 12, 160, AXIS_COLORS[0])
    assert near(image, 120, 160 - 12, AXIS_COLORS[1])
    assert not changed(image)[150:, :].any()


def test_the_frame_itself_stays_as_it_was():
    seen = frame()
    draw_overlay(seen, [ObjectPose("cube", np.zeros(3), UPRIGHT)])
    assert (seen.rgb == GREY).all()


def test_a_pose_without_rotation_is_a_dot():
    image = draw_overlay(frame(), [ObjectPose("lid", np.array([0.1, 0, 0]))])
    assert near(image, 120, 200, COLOR)
    assert not near(image, 120, 215, AXIS_COLORS[0])


def test_every_name_is_legible():
    # ten objects at one place: ten labels that cover ten times the area of one
    one = changed(draw_overlay(frame(), [ObjectPose("cube", np.zeros(3))])).sum()
    ten = changed(draw_overlay(frame(), [ObjectPose("cube", np.zeros(3))] * 10)).sum()
    assert ten > 9 * 0.8 * one


@pytest.mark.parametrize(
    "position_m", [(5, 0, 0), (0, 0, 2), (0, 0, 1), (0, 0, 0.99), (9e3, 0, 0), (0, -9e3, 1)], ids=str
)
@pytest.mark.parametrize("quaternion", [None, UPRIGHT])
def test_an_object_outside_of_the_view_is_named_at_the_bottom(position_m, quaternion):
    pose = ObjectPose("cube", np.array(position_m, float), quaternion)
    image = draw_overlay(frame(), [pose])
    assert (image[-10, :60] == COLOR).all(axis=1).any()


def test_names_stay_inside_of_small_images():
    camera = Camera("top", 20, 20, 8, 6, frame().camera.camera_to_world)
    small = RgbdFrame(camera, np.full((12, 16, 3), GREY, np.uint8))
    assert draw_overlay(small, [ObjectPose("a long name", np.zeros(3), UPRIGHT)] * 3).shape == (12, 16, 3)


def test_colors_are_needed():
    with pytest.raises(InvalidInputError) as caught:
        draw_overlay(RgbdFrame(frame().camera), [])
    assert caught.value.field == "rgb_top"
