from dataclasses import replace

import numpy as np
import pytest

from app.perception.models import model_from_json
from app.perception.object_model import ObjectModelError
from app.perception.registered.click import masks_from_clicks
from app.perception.registered.learn import LabelledView, learn
from app.perception.registered.model import RegisteredModel
from app.perception.registered.template import Template
from roboprompt_client.errors import InvalidInputError
from tests.perception.registered.rooms import frames, layout, taught, view


def without_mask(labelled):
    return LabelledView(tuple(replace(frame, mask=np.zeros_like(frame.mask)) for frame in labelled.frames))


def test_views_merge_and_say_how_well():
    learned = taught("carton")
    assert sorted(learned.merged) == [0, 1]
    assert len(learned.template.scores) == 1
    assert learned.template.scores[0] > 0.85
    size_m = np.ptp(learned.template.points_m, axis=0)
    np.testing.assert_allclose(np.sort(size_m), (0.04, 0.065, 0.105), atol=0.012)


def test_the_origin_is_in_the_middle():
    points_m = taught("carton").template.points_m
    np.testing.assert_allclose(points_m.min(axis=0)[:2] + points_m.max(axis=0)[:2], 0, atol=1e-6)
    assert taught("carton").template.bottom_m == pytest.approx(-0.055, abs=0.004)


def test_a_round_object_is_completed_around_its_axis():
    points_m = taught("jar", 1).template.points_m
    radii_m = np.linalg.norm(points_m[:, :2], axis=1)
    assert np.percentile(radii_m, 98) == pytest.approx(0.041, abs=0.004)
    angles = np.histogram(np.arctan2(points_m[:, 1], points_m[:, 0]), 12)[0]
    assert angles.min() > 0.5 * angles.max()


def test_an_arrow_gives_the_x_axis():
    labelled = replace(view("carton", 0), yaw_deg=40.0)
    plain, turned = (learn("carton", [item], None).template for item in (view("carton", 0), labelled))
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
    everything = LabelledView(tuple(replace(frame, mask=np.ones_like(frame.mask)) for frame in spread))
    with pytest.raises(ObjectModelError, match=r"span \d+ cm, at most 70"):
        learn("carton", [everything], None)


def test_nothing_is_taught_without_a_mask():
    with pytest.raises(ObjectModelError, match="no view shows it"):
        learn("carton", [without_mask(view("carton", 0))], None)


def test_what_is_not_round_is_not_taught_as_round():
    with pytest.raises(ObjectModelError, match="is not round"):
        learn("brick", [view("brick", 0)], 0.0)


def test_what_looks_otherwise_when_turned_is_not_taught_as_symmetric():
    with pytest.raises(ObjectModelError, match=r"turned by 180 degrees it looks otherwise|differs from itself"):
        learn("mug", [view("mug", 0)], 180.0)


def test_what_looks_the_same_all_around_needs_a_symmetry():
    with pytest.raises(ObjectModelError, match="same at every yaw") as caught:
        learn("jar", [view("jar", 0)], None)
    assert "yaw" in caught.value.valid


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


def test_a_model_goes_through_json():
    model = RegisteredModel("ab" * 32, 180.0, views=("x", "y"), scores=(0.9,))
    assert model_from_json("brick", model.as_json()) == model


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"symmetric": 77}, "symmetric"),
        ({"symmetric": "round"}, "symmetric"),
        ({"template": "abc"}, "template"),
        ({"yaw_may_be_unknown": 1}, "yaw_may_be_unknown"),
    ],
)
def test_a_wrong_model_is_refused_by_the_field(change, field):
    with pytest.raises(InvalidInputError) as caught:
        model_from_json("jar", {"estimator": "registered", "template": "0" * 64, **change})
    assert caught.value.field == f"object_models[jar].{field}"


@pytest.mark.parametrize("name", ["carton", "mug", "jar"])
def test_a_click_in_one_camera_gives_the_masks_of_all(name):
    places = {"carton": (0.08, -0.05, 2.0), "jar": (-0.1, 0.1, 0.0), "mug": (0.12, 0.12, -2.0)}
    views = frames(layout(**places), of=(name, 0))
    rows, columns = np.nonzero(views[0].mask)
    click = (float(columns[len(columns) // 2]), float(rows[len(rows) // 2]))
    masks = masks_from_clicks(views, {"front": click})
    for frame in views:
        mine, true = masks[frame.camera.name], (frame.mask > 0) & (frame.depth_m > 0)
        assert np.count_nonzero(mine & true) > 0.8 * np.count_nonzero(true)
        assert np.count_nonzero(mine & ~(frame.mask > 0)) < 0.05 * np.count_nonzero(true)


def test_a_click_on_the_table_is_refused_with_the_height():
    with pytest.raises(InvalidInputError, match=r"-?\d\.\d cm above the table"):
        masks_from_clicks(frames(layout(jar=(0, 0, 0))), {"front": (40.0, 440.0)})
