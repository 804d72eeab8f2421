"""Scenes drawn from their poses."""

from types import SimpleNamespace

import numpy as np
import pytest

from app.store.values import ObjectRecord
from app.web.scene import HEIGHT, WIDTH, object_colors, scene_picture


def points(text):
    return np.array([[float(value) for value in pair.split(",")] for pair in text.split()])


@pytest.mark.parametrize("far_m", [0.0, 0.1, 3.0])
def test_everything_lies_on_the_page(far_m):
    cubes = (
        ObjectRecord("red cube", (0.3, 0.0, 0.8)),
        ObjectRecord("cup", (0.3 - far_m, far_m, 0.8), (0, 0, 0.6, 0.8)),
    )
    places_m = ((0.3, 0.0, 0.8 + far_m), (0.3, far_m, 0.8))
    keyframes = tuple(SimpleNamespace(position_m=place_m, gripper_open=True) for place_m in places_m)
    picture = scene_picture(SimpleNamespace(objects=cubes, keyframes=keyframes))
    drawn = [points(text) for text in (picture["ground"], picture["path"], *(side for side, _, _ in picture["faces"]))]
    assert np.vstack(drawn).min() >= 0
    assert (np.vstack(drawn) <= (WIDTH, HEIGHT)).all()
    assert np.allclose(points(picture["path"]), [(x, y) for x, y, _ in picture["keyframes"]])


def test_a_box_shows_three_sides_and_the_nearer_one_comes_last():
    far, near = ObjectRecord("far", (0.2, 0.2, 0.8)), ObjectRecord("near", (0.5, -0.2, 0.8))
    faces = scene_picture(SimpleNamespace(objects=(near, far), keyframes=()))["faces"]
    assert [shade for _, _, shade in faces].count(0) == 2
    assert len(faces) == 6
    colors = object_colors(["near", "far"])
    assert [color for _, color, _ in faces] == [colors["far"]] * 3 + [colors["near"]] * 3
    # x points to the lower right of the viewer's page: what is nearer lies lower
    assert points(faces[-1][0])[:, 1].mean() > points(faces[0][0])[:, 1].mean()


def test_nothing_is_drawn_of_nothing():
    assert scene_picture(SimpleNamespace(objects=(), keyframes=())) is None


def test_an_object_has_the_color_that_its_name_says():
    colors = object_colors(["cup", "red cube", "maroon_jar", "Blue cube", "teal block", "tray"])
    assert colors["red cube"] == object_colors(["red"])["red"]
    assert colors["Blue cube"] == object_colors(["blue"])["blue"]
    assert colors["teal block"] == object_colors(["green"])["green"]
    assert len(set(colors.values())) == 6
    assert list(object_colors(f"thing {k}" for k in range(40))) == [f"thing {k}" for k in range(40)]
