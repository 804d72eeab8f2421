from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.perception.calibration import calibrate
from app.pipeline.geometry import rigid
from roboprompt_client.calibration.board import CharucoBoard
from roboprompt_client.camera import Camera
from roboprompt_client.errors import InvalidInputError
from tests.perception.flat_scene import Quad, camera, noisy, render

BOARD = CharucoBoard(5, 7, 0.035, 0.026)
POSITION_M = (0.1, -0.12, 0.01)
QUATERNION = Rotation.from_euler("zx", [30, 4], degrees=True).as_quat()
BOARD_TO_WORLD = rigid(POSITION_M, QUATERNION)
VIEW = camera(target_m=(0.1, -0.05, 0))
WIDTH_PX, HEIGHT_PX = 640, 480


def uncalibrated(view=VIEW):
    return replace(view, camera_to_world=np.eye(4))


def picture(view=VIEW, board=BOARD, board_to_world=BOARD_TO_WORLD, seed=0):
    """A noisy picture of the board with its white rim."""
    texture = board.picture()
    square_px = round(board.square_m / 0.0254 * 300)
    size_m = texture.shape[1] / square_px * board.square_m, texture.shape[0] / square_px * board.square_m
    middle = rigid((*np.array(board.size_m) / 2, 0), (0, 0, 0, 1))
    # a third of the texture's resolution is still finer than the picture's
    shown = cv2.resize(texture, None, fx=1 / 3, fy=1 / 3, interpolation=cv2.INTER_AREA)
    quad = Quad(board_to_world @ middle, size_m, shown)
    return noisy(render(view, [quad]), np.random.default_rng(seed)).rgb


PICTURE = picture()


def error_of(found, view=VIEW):
    """Metres and degrees."""
    got, truth = found.camera.camera_to_world, view.camera_to_world
    turn = Rotation.from_matrix(got[:3, :3].T @ truth[:3, :3]).magnitude()
    return np.linalg.norm(got[:3, 3] - truth[:3, 3]), np.degrees(turn)


def test_the_camera_is_found_where_it_stands():
    found = calibrate(uncalibrated(), [PICTURE], BOARD, BOARD_TO_WORLD)
    metres, degrees = error_of(found)
    assert metres < 0.003
    assert degrees < 0.2
    assert found.corners == 24
    assert found.rms_px < 0.2
    assert found.rms_px <= found.max_px < 1
    assert found.camera.image_size_px == (WIDTH_PX, HEIGHT_PX)
    assert found.camera.name == "front"


def test_the_stated_precision_holds():
    errors, sigmas = [], []
    for seed in range(8):
        found = calibrate(uncalibrated(), [picture(seed=seed)], BOARD, BOARD_TO_WORLD)
        errors.append(error_of(found)[1])
        sigmas.append(np.degrees(found.rotation_sigma_rad))
    assert np.sqrt(np.mean(np.square(errors))) < 3 * np.mean(sigmas)


def test_several_pictures_of_one_scene_count_together():
    found = calibrate(uncalibrated(), [PICTURE, picture(seed=1), picture(seed=2)], BOARD, BOARD_TO_WORLD)
    assert found.corners == 72
    assert error_of(found)[0] < 0.003


def test_a_legacy_board():
    board = CharucoBoard(4, 6, 0.04, 0.03, "DICT_4X4_50", legacy=True)
    seen = picture(board=board)
    assert error_of(calibrate(uncalibrated(), [seen], board, BOARD_TO_WORLD))[0] < 0.004
    with pytest.raises(InvalidInputError, match="legacy"):
        calibrate(uncalibrated(), [seen], replace(board, legacy=False), BOARD_TO_WORLD)


def test_a_part_of_the_board_is_enough():
    half = PICTURE.copy()
    half[:, : WIDTH_PX // 2] = 120
    found = calibrate(uncalibrated(), [half], BOARD, BOARD_TO_WORLD)
    assert 8 <= found.corners < 24
    assert error_of(found)[0] < 0.01


@pytest.mark.parametrize(
    ("pictures", "field", "said"),
    [
        ([], "pictures", "none"),
        ([PICTURE, PICTURE[:100]], "pictures", "640x100, 640x480"),
        ([np.full((480, 640, 3), 90, np.uint8)], "pictures[0]", "0 corners and 0 markers"),
        ([PICTURE, np.roll(PICTURE, 6, axis=0)], "pictures[1]", "6.0 px"),
    ],
    ids=["none", "sizes", "no board", "moved"],
)
def test_pictures_that_will_not_do(pictures, field, said):
    with pytest.raises(InvalidInputError) as caught:
        calibrate(uncalibrated(), pictures, BOARD, BOARD_TO_WORLD)
    assert caught.value.field == field
    assert said in caught.value.message


def test_wrong_intrinsics_show_in_the_error():
    wrong = Camera("front", 800, 620, 319.5, 239.5, np.eye(4))
    with pytest.raises(InvalidInputError, match=r"px off any pose"):
        calibrate(wrong, [PICTURE], BOARD, BOARD_TO_WORLD)
    assert calibrate(wrong, [PICTURE], BOARD, BOARD_TO_WORLD, max_rms_px=1).rms_px > 0.5


def test_a_board_that_could_lean_either_way_is_refused():
    small, lens = CharucoBoard(4, 4, 0.03, 0.0225), 4000
    far = replace(camera(eye_m=(0.5, 0.1, 4.0), target_m=(0.1, -0.05, 0)), fx_px=lens, fy_px=lens)
    with pytest.raises(InvalidInputError, match="two poses"):
        calibrate(uncalibrated(far), [picture(far, small)], small, BOARD_TO_WORLD)


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
def test_boards_that_cannot_be(changes, field):
    with pytest.raises(InvalidInputError) as caught:
        replace(BOARD, **changes)
    assert caught.value.field == field


def test_the_picture_to_print_has_the_boards_size():
    picture_px = np.array(BOARD.picture().shape[::-1])
    np.testing.assert_allclose(picture_px * 0.0254 / 300, np.array(BOARD.size_m) + 0.035, atol=0.001)
