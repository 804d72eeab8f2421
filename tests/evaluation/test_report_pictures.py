"""Film strips and overlays of a report."""

import numpy as np
import pytest

from app.evaluation.report.page import duration_text, tokens_text
from app.evaluation.report.pictures import (
    ACTION_COLOR,
    MAX_COLUMNS,
    captions,
    draw_scene,
    film_grid,
    film_tiles,
)
from app.sim.world import calibrated
from roboprompt_client.types.poses import EndEffectorAction


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


CAMERA = calibrated("front")
GREY = np.full((480, 640, 3), 128, np.uint8)
LEVEL = [0.0, 0.0, 0.0, 1.0]


def near(image, pixel, color, radius_px=3):
    """Whether a pixel of about that color lies near `pixel`."""
    u, v = np.rint(pixel).astype(int)
    patch = image[v - radius_px : v + radius_px + 1, u - radius_px : u + radius_px + 1].astype(int)
    return bool((np.abs(patch - color).max(axis=2) < 40).any())


def test_actions_are_a_path_of_dots_that_are_hollow_where_the_gripper_is_open():
    positions = np.array([[0.1, 0.3, 1.0], [0.3, -0.1, 1.1]])
    actions = [EndEffectorAction(positions[0], LEVEL, True), EndEffectorAction(positions[1], LEVEL, False)]
    image = draw_scene(GREY, CAMERA, [], actions)
    opened, closed = CAMERA.project(positions)[0]
    assert near(image, opened, (255, 255, 255), 0)
    assert near(image, closed, ACTION_COLOR, 0)
    assert near(image, (opened + closed) / 2, ACTION_COLOR, 1)
