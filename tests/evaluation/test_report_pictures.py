"""Charts, film strips and overlays of a report."""

import io

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from app.drawing import AXIS_COLORS, AXIS_M, Canvas
from app.evaluation.report.charts import DARK, THEMES, success_chart
from app.evaluation.report.page import duration_text, tokens_text
from app.evaluation.report.pictures import (
    ACTION_COLOR,
    LAST_FRAME_MS,
    MAX_COLUMNS,
    captions,
    draw_scene,
    film_grid,
    film_tiles,
    write_gif,
)
from app.evaluation.scores import Result, Score
from app.pipeline.geometry import backproject
from app.pipeline.success_rate import SuccessRate
from app.sim.world import calibrated
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose


def contrast(a, b):
    """WCAG 2.2's contrast ratio of two colors '#rrggbb'."""
    bright, dark = sorted(map(luminance, (a, b)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def luminance(color):
    srgb = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]


def result(task, method, successes):
    return Result(task, method, Score(SuccessRate(successes, 4)))


def test_the_success_chart_has_a_bar_and_an_interval_a_method_and_task():
    figure = success_chart([result(t, m, k) for t in ("a", "b") for m, k in (("x", 0), ("y", 3))], DARK)
    axes = figure.axes[0]
    assert [bar.get_width() for bar in axes.patches] == [0, 0, 75, 75]
    low, high = SuccessRate(3, 4).interval
    whiskers = axes.collections[1].get_segments()[0]
    np.testing.assert_allclose(whiskers[:, 0], [100 * low, 100 * high])
    assert [label.get_text() for label in axes.get_yticklabels()] == ["a", "b"]


@pytest.mark.parametrize("theme", THEMES, ids=lambda theme: theme.name)
def test_charts_are_legible(theme):
    for text in (theme.text, theme.muted):
        assert contrast(text, theme.background) >= 4.5
    for color in theme.series:
        assert contrast(theme.text, color) >= 3


@pytest.mark.parametrize("theme", THEMES, ids=lambda theme: theme.name)
def test_figures_have_the_theme_s_background(theme):
    image = io.BytesIO()
    success_chart([result("a", "x", 1)], theme).savefig(image, format="png")
    red, green, blue = Image.open(image).convert("RGB").getpixel((0, 0))
    assert f"#{red:02x}{green:02x}{blue:02x}" == theme.background


def test_numbers_for_people():
    assert [duration_text(s) for s in (None, 0.0063, 1.24, 125.2)] == ["\N{EN DASH}", "6.3 ms", "1.24 s", "2 min 5 s"]
    assert [tokens_text(n) for n in (None, 0, 2174.0)] == ["\N{EN DASH}", "0", "2,174"]


COLORS = [(200, 30, 30), (30, 200, 30), (30, 30, 200), (200, 200, 30), (30, 200, 200)]


def tiles(number):
    images = [np.full((480, 640, 3), color, np.uint8) for color in COLORS[:number]]
    return film_tiles(images, captions(number, 7))


def test_captions_say_what_was_done():
    assert captions(3, 7) == ["before", "after action 1 of 7", "after action 2 of 7"]
    assert captions(2, None) == ["before", "after action 1"]


@pytest.mark.parametrize("number", [1, MAX_COLUMNS, 5])
def test_a_grid_shows_every_tile_in_order(number):
    shown = tiles(number)
    grid = film_grid(shown)
    height, width = shown[0].shape[:2]
    for k, color in enumerate(COLORS[:number]):
        row, column = divmod(k, MAX_COLUMNS)
        inside = grid[row * height + height // 3, column * width + width // 2]
        np.testing.assert_array_equal(inside, color)


def test_a_tile_has_its_caption_below_the_picture():
    plain, captioned = (film_tiles([np.zeros((480, 640, 3), np.uint8)], [text])[0] for text in ("", "before"))
    rows = np.nonzero((plain != captioned).any(axis=(1, 2)))[0]
    assert rows.min() >= 240
    assert captioned.max() > 200


def test_an_animation_plays_every_picture_and_rests_on_the_last(tmp_path):
    write_gif(tmp_path / "film.gif", tiles(4))
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 4
        assert film.info["loop"] == 0
        for k, color in enumerate(COLORS[:4]):
            film.seek(k)
            pixel = film.convert("RGB").getpixel((160, 100))
            assert np.abs(np.subtract(pixel, color)).max() < 12
        assert film.info["duration"] == LAST_FRAME_MS


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
