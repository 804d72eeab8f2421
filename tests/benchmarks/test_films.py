"""The moving picture of the method: a scene beside the text, and at full length a solved task."""

import numpy as np
import pytest
from PIL import Image

from benchmarks.films import DONE, LAST_MS, SCENE_PX, TEXT_WIDTH_PX, Asked, draw_frame, make_moving_picture

ASKED = Asked(
    ("A cube 1 2 3; lift it > 1 A w: +0 +0 +0 0 36 36 0",), "A cube 4 5 6; lift it >", ("1 A w: +0 +0 +0",), ()
)
SCENE = np.full((48, 64, 3), 200, np.uint8)


def green_pixels(num_rows, num_done):
    frame = np.asarray(draw_frame(SCENE, ASKED, num_rows, num_done))
    assert frame.shape == (SCENE_PX[1], SCENE_PX[0] + TEXT_WIDTH_PX, 3)
    assert (frame[:, : SCENE_PX[0]] == 200).all()
    green = tuple(int(DONE[k : k + 2], 16) for k in (1, 3, 5))
    return int((frame == green).all(axis=2).sum())


def test_rows_turn_green_once_they_are_carried_out():
    assert green_pixels(0, 0) == green_pixels(1, 0) == 0
    assert green_pixels(1, 1) > 20


@pytest.mark.long
def test_a_task_from_demonstrations_to_success(tmp_path):
    path = tmp_path / "film.gif"
    assert make_moving_picture("push_button", 700_000, 3, path) == ""
    with Image.open(path) as film:
        assert film.n_frames > 10
        film.seek(film.n_frames - 1)
        assert film.info["duration"] == LAST_MS
