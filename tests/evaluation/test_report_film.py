import numpy as np
import pytest
from PIL import Image

from app.evaluation.report.pictures import LAST_FRAME_MS, MAX_COLUMNS, captions, film_grid, film_tiles, write_gif

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
