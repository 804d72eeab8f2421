import json

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import application
from app.perception.images import decode_rgb
from tests.perception.test_calibrate import BOARD, PICTURE, POSITION_M, QUATERNION, VIEW

INTRINSICS = [VIEW.fx_px, VIEW.fy_px, VIEW.cx_px, VIEW.cy_px]


def run(*arguments):
    return CliRunner().invoke(application, [str(item) for item in arguments])


@pytest.fixture
def picture(tmp_path):
    path = tmp_path / "board seen.png"
    path.write_bytes(cv2.imencode(".png", PICTURE[..., ::-1])[1].tobytes())
    return path


def calibrate(*arguments):
    pose = ["--board-position", *POSITION_M, "--board-quaternion", *QUATERNION]
    return run("calibrate", *arguments, "--intrinsics", *INTRINSICS, *pose)


def test_it_prints_a_camera_as_uploads_need_it(picture):
    result = calibrate(picture, "--name", "left", "--depth-scale", 0.0005)
    assert result.exit_code == 0, result.stderr
    camera = json.loads(result.stdout)
    assert camera["name"] == "left"
    assert camera["depth_scale"] == 0.0005
    intrinsics = dict(zip(("fx", "fy", "cx", "cy"), INTRINSICS, strict=True), width=640, height=480)
    assert camera["intrinsics"] == intrinsics
    np.testing.assert_allclose(camera["camera_to_world"], VIEW.camera_to_world, atol=0.005)
    assert "24 corners in 1 picture(s)" in result.stderr


def test_what_is_wrong_is_said(picture, tmp_path):
    for arguments, said in (
        ([picture, "--rows", 5, "--columns", 9], "pictures[0]"),
        ([picture, "--dictionary", "DICT_9X9"], "DICT_5X5_100"),
        ([picture, "--name", "}{"], "cameras.name"),
        ([tmp_path / "none.png"], "none.png"),
        ([picture, "--max-error", 0.01], "px off any pose"),
    ):
        result = calibrate(*arguments)
        assert result.exit_code == 1
        assert said in result.stderr
        assert result.stdout == ""


def test_a_board_to_print(tmp_path):
    out = tmp_path / "board.png"
    result = run("calibration-board", out)
    assert result.exit_code == 0, result.stderr
    assert "17.5 x 24.5 cm" in result.stdout
    corners_px, ids, _ = BOARD.find(decode_rgb("board", out.read_bytes()))
    assert len(ids) == 24
    square_px = np.linalg.norm(corners_px[1] - corners_px[0])
    assert square_px / 300 * 0.0254 == pytest.approx(BOARD.square_m, rel=0.01)
    assert run("calibration-board", tmp_path / "nowhere" / "board.png").exit_code == 1
    assert run("calibration-board", out, "--marker", 0.1).exit_code == 1
