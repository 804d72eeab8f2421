import numpy as np
import pytest

from app.drawing import AXIS_COLORS
from app.perception.base import ObjectQuery
from app.perception.cuboid.model import ColorModel, CuboidModel
from app.perception.markers.model import Marker, MarkersModel
from app.perception.models import RemoteModel
from app.perception.overlay import PALETTE, draw_overlay, outlines
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.poses import ObjectPose

HEIGHT, WIDTH = 240, 320
GREY = 200
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
COLOR = np.array(PALETTE[0])


def frame(rgb=None, mask=None):
    """A camera 1 m above the origin that looks down, the world's x to the right, its y up in the image."""
    pose = np.eye(4)
    pose[:3, :3] = np.diag([1, -1, -1])
    pose[2, 3] = 1
    grey = np.full((HEIGHT, WIDTH, 3), GREY, np.uint8)
    return RgbdFrame(Camera("top", 400, 400, 160, 120, pose), grey if rgb is None else rgb, mask=mask)


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


def test_a_cuboid_is_outlined_at_its_size():
    model = CuboidModel((0.2, 0.1, 0.02), ColorModel((0, 10)), origin_m=(0, 0, 0.01))
    image = draw_overlay(frame(), [ObjectPose("box", np.zeros(3), UPRIGHT)], [ObjectQuery("box", model=model)])
    # the origin lies on its top, 1 m from the camera: 80 x 40 px
    for row, column in ((120, 120), (120, 200), (140, 140), (100, 130)):
        assert near(image, row, column, COLOR)
    assert not near(image, 120, 208, COLOR, within=20)


def test_outlines_hold_the_shape():
    box = CuboidModel((0.2, 0.1, 0.04), ColorModel((0, 10)), origin_m=(0, 0, 0.02))
    corners = np.concatenate(outlines(box))
    np.testing.assert_allclose(corners.min(axis=0), [-0.1, -0.05, -0.04])
    np.testing.assert_allclose(corners.max(axis=0), [0.1, 0.05, 0], atol=1e-12)
    round_ = CuboidModel((0.1, 0.1, 0.04), ColorModel((0, 10)), shape="cylinder")
    radii = np.linalg.norm(np.concatenate(outlines(round_))[:, :2], axis=1)
    np.testing.assert_allclose(radii, 0.05)
    raised = tuple(map(tuple, (np.eye(4) + 0.3 * np.eye(4, k=1) * np.array([[0], [0], [1], [0]])).tolist()))
    (square,) = outlines(MarkersModel("DICT_4X4_50", (Marker(1, 0.04, raised),)))
    np.testing.assert_allclose(square[:2], [[-0.02, 0.02, 0.3], [0.02, 0.02, 0.3]])
    assert outlines(None) == outlines(RemoteModel("http://127.0.0.1/poses")) == []


def test_masks_are_tinted():
    mask = np.zeros((HEIGHT, WIDTH), np.int32)
    mask[200:220, 10:40] = 7
    pose = ObjectPose("lid", np.zeros(3))
    image = draw_overlay(frame(mask=mask), [pose], [ObjectQuery("lid", mask_ids=(7,))])
    np.testing.assert_allclose(image[210, 25], 0.65 * GREY + 0.35 * COLOR, atol=1)
    assert not changed(image)[200:220, 50:].any()


def test_pixels_of_a_cuboids_color_are_tinted():
    rgb = np.full((HEIGHT, WIDTH, 3), GREY, np.uint8)
    rgb[200:220, 10:40] = (220, 20, 20)
    query = ObjectQuery("cube", model=CuboidModel((0.05,) * 3, ColorModel((345, 15))))
    image = draw_overlay(frame(rgb), [ObjectPose("cube", np.zeros(3), UPRIGHT)], [query])
    np.testing.assert_allclose(image[210, 25], 0.65 * np.array([220, 20, 20]) + 0.35 * COLOR, atol=1)


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
    model = CuboidModel((0.05,) * 3, ColorModel((345, 15)))
    pose = ObjectPose("cube", np.array(position_m, float), quaternion)
    image = draw_overlay(frame(), [pose], [ObjectQuery("cube", model=model)])
    assert (image[-10, :60] == COLOR).all(axis=1).any()


def test_names_stay_inside_of_small_images():
    camera = Camera("top", 20, 20, 8, 6, frame().camera.camera_to_world)
    small = RgbdFrame(camera, np.full((12, 16, 3), GREY, np.uint8))
    assert draw_overlay(small, [ObjectPose("a long name", np.zeros(3), UPRIGHT)] * 3).shape == (12, 16, 3)


def test_colors_are_needed():
    with pytest.raises(InvalidInputError) as caught:
        draw_overlay(RgbdFrame(frame().camera), [])
    assert caught.value.field == "rgb_top"
