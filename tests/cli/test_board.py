"""The ChArUco board of `roboprompt calibration-board`, and how it is found in pictures."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from app.cli import application
from app.perception.images import decode_rgb
from app.pipeline.geometry import rigid
from roboprompt_client.cameras.board import CharucoBoard, check_seen, find_board
from roboprompt_client.errors import InvalidInputError
from synthetic.camera_noise import as_a_camera_sees_it
from tests.perception.flat_scene import Quad, camera, render

BOARD = CharucoBoard(5, 7, 0.035, 0.026)
BOARD_TO_WORLD = rigid((0.1, -0.12, 0.01), Rotation.from_euler("zx", [30, 4], degrees=True).as_quat())
VIEW = camera(target_m=(0.1, -0.05, 0))


def found(board, view=VIEW, known=None):
    """The board's pose before the camera, (4, 4), from a noisy picture of it; `known`: what it is taken for."""
    texture = board.picture()
    square_px = round(board.square_m / 0.0254 * 300)
    size_m = texture.shape[1] / square_px * board.square_m, texture.shape[0] / square_px * board.square_m
    middle = rigid((*np.array(board.size_m) / 2, 0), (0, 0, 0, 1))
    # a third of the texture's resolution is still finer than the picture's
    shown = cv2.resize(texture, None, fx=1 / 3, fy=1 / 3, interpolation=cv2.INTER_AREA)
    picture = render(view, [Quad(BOARD_TO_WORLD @ middle, size_m, shown)])
    seen = as_a_camera_sees_it(picture, np.random.default_rng(0)).rgb
    corners_px, ids, markers = (known or board).find(seen)
    check_seen("picture", ids, markers, known or board)
    matrix = np.array([[view.fx_px, 0, view.cx_px], [0, view.fy_px, view.cy_px], [0, 0, 1]])
    turn, shift = find_board(board.corners_m[ids], corners_px, matrix)
    return rigid(shift.ravel(), Rotation.from_rotvec(turn.ravel()).as_quat())


@pytest.mark.parametrize("board", [BOARD, CharucoBoard(4, 6, 0.04, 0.03, "DICT_4X4_50", legacy=True)])
def test_a_board_is_found_where_it_lies(board):
    np.testing.assert_allclose(VIEW.camera_to_world @ found(board), BOARD_TO_WORLD, atol=0.004)


def test_a_legacy_board_is_no_newer_one():
    board = CharucoBoard(4, 6, 0.04, 0.03, "DICT_4X4_50", legacy=True)
    with pytest.raises(InvalidInputError, match="legacy"):
        found(board, known=replace(board, legacy=False))


def test_a_board_that_could_lean_either_way_is_refused():
    far = replace(camera(eye_m=(0.5, 0.1, 4.0), target_m=(0.1, -0.05, 0)), fx_px=4000, fy_px=4000)
    with pytest.raises(InvalidInputError, match="two poses"):
        found(CharucoBoard(4, 4, 0.03, 0.0225), far)


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"columns": 2}, "columns"),
        ({"rows": 5.5}, "rows"),
        ({"square_m": 0}, "square_m"),
        ({"marker_m": 0.035}, "marker_m"),
        ({"marker_m": float("nan")}, "marker_m"),
        ({"dictionary": "DICT_9X9"}, "dictionary"),
        ({"dictionary": "DICT_4X4_50", "columns": 12, "rows": 12}, "dictionary"),
    ],
)
def test_impossible_boards_are_refused(changes, field):
    with pytest.raises(InvalidInputError) as caught:
        replace(BOARD, **changes)
    assert caught.value.field == field


def run(*arguments):
    return CliRunner().invoke(application, ["calibration-board", *map(str, arguments)])


def test_a_board_to_print(tmp_path):
    out = tmp_path / "board.png"
    result = run(out)
    assert result.exit_code == 0, result.stderr
    assert "17.5 x 24.5 cm" in result.stdout
    corners_px, ids, _ = BOARD.find(decode_rgb("board", out.read_bytes()))
    assert len(ids) == 24
    square_px = np.linalg.norm(corners_px[1] - corners_px[0])
    assert square_px / 300 * 0.0254 == pytest.approx(BOARD.square_m, rel=0.01)
    assert run(tmp_path / "nowhere" / "board.png").exit_code == 1
    assert run(out, "--marker", 0.1).exit_code == 1
