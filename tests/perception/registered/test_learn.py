from dataclasses import replace

import numpy as np
import pytest

from app.perception.object_model import ObjectModelError
from app.perception.registered.learn import LabeledView, learn
from app.perception.registered.marks import Marks, masks_from_marks, outlines, yaw_of_arrow_deg
from app.perception.registered.scene import Scene
from app.perception.registered.symmetry import completed, symmetry_remedy
from app.perception.registered.template import Template
from roboprompt_client.errors import InvalidInputError
from synthetic.object_scenes import sample
from tests.perception.registered.rooms import PLACES, frames, layout, taught, view


def without_mask(labeled):
    return LabeledView(tuple(replace(frame, mask=np.zeros_like(frame.mask)) for frame in labeled.frames))


def test_views_merge_and_say_how_well():
    learned = taught("carton")
    assert sorted(learned.merged) == [0, 1]
    assert len(learned.template.scores) == 1
    assert learned.template.scores[0] > 0.85
    size_m = np.ptp(learned.template.points_m, axis=0)
    np.testing.assert_allclose(np.sort(size_m), (0.04, 0.065, 0.105), atol=0.012)


def test_views_on_two_tables_merge():
    where = layout(carton=PLACES[1])
    where.table_rgb = (0.2, 0.3, 0.6)
    views = [view("carton", 0), LabeledView(frames(where, 1, of=("carton", 0)))]
    assert sorted(learn("carton", views, None).merged) == [0, 1]


def test_the_origin_is_in_the_middle():
    points_m = taught("carton").template.points_m
    np.testing.assert_allclose(points_m.min(axis=0)[:2] + points_m.max(axis=0)[:2], 0, atol=1e-6)
    assert taught("carton").template.bottom_m == pytest.approx(-0.055, abs=0.004)
    assert abs(taught("jar").template.points_m[:, :2].mean(axis=0)).max() < 0.005  # wherever it stood


def test_a_round_object_is_completed_around_its_axis():
    points_m = taught("jar", 1).template.points_m
    radii_m = np.linalg.norm(points_m[:, :2], axis=1)
    assert np.percentile(radii_m, 98) == pytest.approx(0.041, abs=0.004)
    angles = np.histogram(np.arctan2(points_m[:, 1], points_m[:, 0]), 12)[0]
    assert angles.min() > 0.5 * angles.max()


def test_an_arrow_gives_the_x_axis():
    labeled = replace(view("carton", 0), yaw_deg=40.0)
    plain, turned = (learn("carton", [item], None).template for item in (view("carton", 0), labeled))
    heading = np.radians(40.0)
    turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    expected_m = plain.points_m[:, :2] @ turn.T
    np.testing.assert_allclose(np.ptp(turned.points_m[:, :2], axis=0), np.ptp(expected_m, axis=0), atol=1e-6)


def test_a_view_without_the_object_is_left_out_with_the_reason():
    views = [view("carton", 0), without_mask(view("carton", 1)), view("carton", 2)]
    learned = learn("carton", views, None)
    assert sorted(learned.merged) == [0, 2]
    assert "0 points" in learned.refused[1]


def test_nothing_is_taught_where_no_view_fits_another():
    with pytest.raises(ObjectModelError, match=r"none of the 2 views fits another: view [01]") as caught:
        learn("thing", [view("carton", 0), view("mug", 1)], None)
    assert caught.value.name == "thing"


def test_a_mask_of_half_the_table_is_no_object():
    spread = frames(layout(carton=(-0.3, 0.1, 0.0), jar=(0.3, 0.1, 0.0)))
    everything = LabeledView(tuple(replace(frame, mask=np.ones_like(frame.mask)) for frame in spread))
    with pytest.raises(ObjectModelError, match=r"span \d+ cm, at most 70"):
        learn("carton", [everything], None)


def test_nothing_is_taught_without_a_mask():
    with pytest.raises(ObjectModelError, match="no view shows it"):
        learn("carton", [without_mask(view("carton", 0))], None)


def test_what_is_not_round_is_not_taught_as_round():
    with pytest.raises(ObjectModelError, match="is not round"):
        learn("brick", [view("brick", 0)], 0.0)


def test_a_nearly_flat_side_is_not_completed_around_an_axis_meters_away():
    angles = np.random.default_rng(0).uniform(-0.02, 0.02, 500)
    normals = np.column_stack([-np.cos(angles), -np.sin(angles), np.zeros(500)])
    points_m = 5 * (normals + np.array([1.0, 0.0, 0.0])) + np.linspace(0, 0.2, 500)[:, None] * (0, 0, 1)
    flat = replace(taught("carton").template, points_m=points_m, normals=normals, rgb=np.full((500, 3), 90.0))
    with pytest.raises(ObjectModelError, match=r"would be \d+ cm wide around its axis, at most 70"):
        completed("door", replace(flat, yaw_symmetry_deg=0.0))


def test_what_looks_otherwise_when_turned_is_not_taught_as_symmetric():
    for number in (1, 2):
        with pytest.raises(ObjectModelError, match=r"turned by 180 degrees it looks otherwise|differs from itself"):
            learn("mug", [view("mug", k) for k in range(number)], 180.0)


def test_a_handle_that_the_first_view_hides_is_no_symmetry():
    random = np.random.default_rng(0)
    scenes = [sample(random, [("mug", 0)]) for _ in range(2)]
    views = [LabeledView(frames(scene, seed, of=("mug", 0), num=2)) for seed, scene in enumerate(scenes)]
    with pytest.raises(ObjectModelError, match="turned by 180 degrees it looks otherwise"):
        learn("mug", views, 180.0)


def test_what_looks_the_same_all_around_needs_a_symmetry():
    with pytest.raises(ObjectModelError, match=r"turned by .* degrees it looks the same in 1 of 1 views") as caught:
        learn("jar", [view("jar", 0)], None)
    assert 'symmetric: "yaw"' in caught.value.valid


def test_what_looks_the_same_from_behind_is_taught_as_symmetric_only():
    with pytest.raises(ObjectModelError, match=r"turned by 1[78]\d degrees it looks the same in 2 of") as caught:
        learn("brick", [replace(view("brick", k), yaw_deg=yaw_deg) for k, yaw_deg in enumerate((20.0, 90.0))], None)
    assert "symmetric: 180 if" in caught.value.valid


@pytest.mark.parametrize(
    ("name", "turns", "suggested"),
    [("brick", (178.0,), "symmetric: 180"), ("carton", (90.0, 180.0, 270.0), "a further")],
)
def test_a_symmetry_is_suggested_only_where_the_shape_has_it(name, turns, suggested):
    template = replace(taught(name).template, yaw_symmetry_deg=None)
    assert symmetry_remedy(template, turns).startswith(suggested)


def test_a_template_is_the_same_after_its_way_through_a_file():
    template = taught("brick").template
    data = template.to_bytes()
    again = Template.from_bytes(data)
    np.testing.assert_allclose(again.points_m, template.points_m, atol=1e-6)
    np.testing.assert_allclose(again.rgb, template.rgb, atol=0.51)
    assert (again.yaw_symmetry_deg, again.scores) == (180.0, template.scores)
    assert [item.depth_m.shape for item in again.free_views] == [item.depth_m.shape for item in template.free_views]
    assert len(data) < 1_000_000
    assert template.to_bytes() == data


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04nothing", taught("jar", 1).template.to_bytes()[:-300]])
def test_a_damaged_file_is_refused(data):
    with pytest.raises(InvalidInputError, match="is no template"):
        Template.from_bytes(data)


def masks_of(views, marks):
    return masks_from_marks(Scene.of(views), views, marks)


def assert_holds_the_object(masks, views):
    for frame in views:
        mine, true = masks[frame.camera.name], (frame.mask > 0) & (frame.depth_m > 0)
        assert np.count_nonzero(mine & true) > 0.8 * np.count_nonzero(true)
        assert np.count_nonzero(mine & ~(frame.mask > 0)) < 0.06 * np.count_nonzero(true)


def pixel_of(frame, place_m):
    return tuple(frame.camera.project(place_m)[0].tolist())


def box_around(mask):
    rows, columns = np.nonzero(mask)
    return tuple(float(edge) for edge in (columns.min(), rows.min(), columns.max(), rows.max()))


def touching():
    """A carton that a jar touches, the carton's masks, and a pixel of each in the first camera."""
    views = frames(layout(carton=(0, 0, 0), jar=(0.062, 0, 0)), of=("carton", 0))
    return views, pixel_of(views[0], (-0.02, -0.02, 0.06)), pixel_of(views[0], (0.06, -0.03, 0.05))


def test_a_click_on_what_it_touches_takes_that_away():
    views, on, off = touching()
    both = masks_of(views, Marks({"front": [on]}))
    assert np.count_nonzero(both["front"]) > 2 * np.count_nonzero(views[0].mask)
    assert_holds_the_object(masks_of(views, Marks({"front": [on]}, {"front": [off]})), views)


def test_two_clicks_hold_two_parts_and_a_box_bounds_the_mask():
    views, _, _ = touching()
    assert_holds_the_object(masks_of(views, Marks(boxes={"front": box_around(views[0].mask)})), views)
    apart = frames(layout(carton=(0, 0, 0), jar=(0.12, 0, 0)), of=("carton", 0))
    pixels = [pixel_of(apart[0], (x_m, -0.03, 0.05)) for x_m in (0, 0.12)]
    one, other, both = (masks_of(apart, Marks({"front": clicks})) for clicks in ([pixels[0]], [pixels[1]], pixels))
    for name, mask in both.items():
        np.testing.assert_array_equal(mask, one[name] | other[name])


@pytest.mark.parametrize("name", ["carton", "mug", "jar"])
def test_a_click_in_one_camera_gives_the_masks_of_all(name):
    places = {"carton": (0.08, -0.05, 2.0), "jar": (-0.1, 0.1, 0.0), "mug": (0.12, 0.12, -2.0)}
    views = frames(layout(**places), of=(name, 0))
    rows, columns = np.nonzero(views[0].mask)
    click = (float(columns[len(columns) // 2]), float(rows[len(rows) // 2]))
    assert_holds_the_object(masks_of(views, Marks({"front": [click]})), views)


def test_a_click_on_the_table_is_refused_with_the_height():
    with pytest.raises(InvalidInputError, match=r"-?\d\.\d cm above the table"):
        masks_of(frames(layout(jar=(0, 0, 0))), Marks({"front": [(40.0, 440.0)]}))


@pytest.mark.parametrize(
    ("marks", "words"),
    [
        (Marks(boxes={"front": (2.0, 2.0, 9.0, 9.0)}), "nothing stands on the table"),
        (Marks({"front": [(700.0, 9.0)]}), "a pixel of the image"),
        (Marks({"front": [(362.0, 230.0)]}, boxes={"front": (303.0, 159.0, 312.0, 256.0)}), "leaves nothing"),
    ],
)
def test_marks_that_hold_nothing_are_refused(marks, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        masks_of(touching()[0], marks)
    assert caught.value.field.startswith(("boxes[front]", "clicks["))


@pytest.mark.parametrize("yaw_deg", [-120.0, 10.0, 95.0])
def test_an_arrow_on_an_object_says_its_yaw(yaw_deg):
    views, _, _ = touching()
    top_m, yaw = np.array([0.0, 0.0, 0.11]), np.radians(yaw_deg)
    ahead_m = top_m + 0.08 * np.array([np.cos(yaw), np.sin(yaw), 0])
    tail, head = (pixel_of(views[0], place_m) for place_m in (top_m, ahead_m))
    assert abs((yaw_of_arrow_deg(views[0], tail, head) - yaw_deg + 180) % 360 - 180) < 8
    with pytest.raises(InvalidInputError, match="no such arrow"):
        yaw_of_arrow_deg(views[0], tail, tail)


def test_outlines_go_around_parts_and_holes():
    mask = np.zeros((40, 40), bool)
    mask[5:30, 5:30] = True
    mask[12:20, 12:20] = False
    outer, hole = sorted(outlines(mask), key=lambda corners: -np.ptp(corners, axis=0).max())
    assert {tuple(corner) for corner in outer} == {(5, 5), (5, 29), (29, 29), (29, 5)}
    assert np.ptp(hole, axis=0).tolist() == [9, 9]
