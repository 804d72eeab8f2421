from dataclasses import replace

import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.perception.masks import MaskedPoints
from app.perception.models import MasksModel
from app.pipeline.errors import ObjectNotVisibleError, UncertainPoseError
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.quaternions import yaw_rad
from tests.perception.solid_scene import FRONT, LEFT, Solid, cube, shoot

HEIGHT, WIDTH, F_PX = 4, 6, 100
CUP, PLATE = 98, 7


def frame(name, origin_m, depth_m=2.0, **ids):
    """A camera whose axes are the world's; `ids` places object ids by pixel: r1c2=98."""
    camera_to_world = np.eye(4)
    camera_to_world[:3, 3] = origin_m
    mask = np.zeros((HEIGHT, WIDTH), np.int32)
    for place, number in ids.items():
        mask[int(place[1]), int(place[3])] = number
    depth = np.full((HEIGHT, WIDTH), depth_m, np.float32)
    return RgbdFrame(Camera(name, F_PX, F_PX, 2.0, 1.0, camera_to_world), depth_m=depth, mask=mask)


def estimate(frames, *queries):
    return MaskedPoints().estimate(queries or [ObjectQuery("cup", mask_ids=(CUP,))], frames)


def test_one_cameras_pixels_are_averaged():
    # pixels right of the optical axis by 0, 1 and 2: 2 cm each at 2 m; the last lies one row lower
    (cup,) = estimate([frame("front", (0.5, 0, 0), r1c2=CUP, r1c3=CUP, r2c4=CUP, r0c0=PLATE)])
    np.testing.assert_allclose(cup.position_m, [0.52, 0.02 / 3, 2], atol=1e-9)
    assert (cup.name, cup.quaternion_xyzw, cup.estimator, cup.cameras) == ("cup", None, "masks", ("front",))


def test_it_is_said_that_the_place_is_the_centroid_of_what_is_visible():
    (cup,) = estimate([frame("front", (0.5, 0, 0), r1c2=CUP)])
    assert cup.confidence < 1
    assert cup.reason == "centroid of the visible surface, 1 to 4 cm from the middle, depends on the view"


def test_cameras_weigh_alike_however_many_pixels_they_see():
    many = frame("front", (0, 0, 0), r1c2=CUP, r1c3=CUP, r1c4=CUP)  # mean x 0.02
    one = frame("left", (0.1, 0, 0), 3.0, r1c2=CUP)  # x 0.1
    none = frame("right", (9, 9, 9))
    (cup,) = estimate([many, none, one])
    np.testing.assert_allclose(cup.position_m, [0.06, 0, 2.5], atol=1e-9)
    assert cup.cameras == ("front", "left")


def test_an_object_can_have_several_ids_and_objects_come_in_the_order_asked():
    seen = frame("front", (0, 0, 0), r1c2=CUP, r1c4=CUP + 1, r1c0=PLATE)
    plate, cup = estimate(
        [seen], ObjectQuery("plate", mask_ids=(PLATE,)), ObjectQuery("cup", mask_ids=(CUP, CUP + 1, 2**70))
    )
    np.testing.assert_allclose(plate.position_m, [-0.04, 0, 2], atol=1e-9)
    np.testing.assert_allclose(cup.position_m, [0.02, 0, 2], atol=1e-9)


def test_pixels_of_unknown_depth_do_not_count():
    seen = frame("front", (0, 0, 0), r1c2=CUP, r1c3=CUP)
    seen.depth_m[1, 3] = 0
    (cup,) = estimate([seen])
    np.testing.assert_allclose(cup.position_m, [0, 0, 2], atol=1e-9)
    seen.depth_m[1, 2] = 0
    with pytest.raises(ObjectNotVisibleError):
        estimate([seen])


def test_an_object_that_no_camera_sees_is_named():
    frames = [frame("front", (0, 0, 0), r1c2=CUP), frame("left", (0, 0, 0))]
    queries = [ObjectQuery("cup", mask_ids=(CUP,)), ObjectQuery("red plate", mask_ids=(PLATE, 8))]
    with pytest.raises(ObjectNotVisibleError, match=r"front, left.*\[7, 8\]") as caught:
        estimate(frames, *queries)
    assert caught.value.field == "objects[red plate]"


def test_mask_ids_are_needed():
    with pytest.raises(InvalidInputError) as caught:
        estimate([frame("front", (0, 0, 0))], ObjectQuery("cup", (0, 0, 1)))
    assert caught.value.field == "objects[cup].mask_ids"


def test_a_mask_needs_depth_beside_it():
    seen = frame("front", (0, 0, 0), r1c2=CUP)
    with pytest.raises(InvalidInputError) as caught:
        estimate([RgbdFrame(seen.camera, mask=seen.mask)])
    assert caught.value.field == "depth_front"


def test_some_camera_needs_a_mask():
    seen = frame("front", (0, 0, 0), r1c2=CUP)
    unmasked = RgbdFrame(Camera("left", F_PX, F_PX, 2.0, 1.0, np.eye(4)), depth_m=seen.depth_m)
    for frames in ([], [unmasked]):
        with pytest.raises(InvalidInputError) as caught:
            estimate(frames)
        assert caught.value.field == "cameras"
    assert estimate([unmasked, seen])[0].cameras == ("front",)


def boxed(solids, model, views=(FRONT,)):
    query = ObjectQuery("thing", mask_ids=(1,), model=model)
    return MaskedPoints().estimate([query], [shoot(solids, view) for view in views])[0]


def yaw_deg(pose):
    return np.degrees(yaw_rad(pose.quaternion_xyzw))


@pytest.mark.parametrize("views", [(FRONT,), (FRONT, LEFT)])
def test_a_cubes_yaw_is_given_in_its_quarter_turn_and_its_position_stays(views):
    solids = [cube("red", 0, 0.02, 0.5 + np.pi / 2)]
    pose = boxed(solids, MasksModel(rotation=True), views)
    assert yaw_deg(pose) == pytest.approx(np.degrees(0.5), abs=3)
    plain = boxed(solids, None, views)
    assert plain.quaternion_xyzw is None
    np.testing.assert_array_equal(pose.position_m, plain.position_m)


def test_the_longer_side_is_the_x_axis_whatever_color_it_has():
    bar = Solid("grey", (0, 0, 0.02), -1.0, (0.09, 0.05, 0.04))
    assert yaw_deg(boxed([bar], MasksModel(True, 180))) == pytest.approx(np.degrees(-1.0), abs=3)


def test_what_has_no_yaw_is_refused():
    with pytest.raises(UncertainPoseError, match="looks round"):
        boxed([Solid("red", (0, 0, 0.02), 0, (0.07, 0.07, 0.04), round=True)], MasksModel(True))
    with pytest.raises(UncertainPoseError, match="too alike for a heading"):
        boxed([cube("red", 0, 0, 0.3)], MasksModel(True, 180))


def test_an_object_with_few_masked_pixels_has_no_rotation_and_is_refused():
    frame = shoot([cube("red", 0, 0.02, 0.5)], FRONT)
    rows, columns = np.nonzero(frame.mask == 1)
    mask = np.zeros_like(frame.mask)
    mask[rows[:30], columns[:30]] = 1
    query = ObjectQuery("thing", mask_ids=(1,), model=MasksModel(rotation=True))
    with pytest.raises(ObjectNotVisibleError, match="fewer than 40 masked pixels have depth"):
        MaskedPoints().estimate([query], [replace(frame, mask=mask)])
