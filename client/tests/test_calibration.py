"""Cameras against the arm, from corners that are computed and from pictures that are drawn."""

import json
import time

import numpy as np
import pytest
from arms import type_command
from makers import Body, Plain

pytest.importorskip("cv2", reason="the extra `calibrate` is not installed")
pytest.importorskip("scipy", reason="the extra `calibrate` is not installed")

import cv2

from roboprompt_client.arms.arm import Arm
from roboprompt_client.cameras.board import CharucoBoard
from roboprompt_client.cameras.calibration import Sighting, fit_cameras
from roboprompt_client.cameras.rig import Intrinsics, MountedCamera, Picture, Rig
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.types.poses import Pose

BOARD = CharucoBoard(5, 7, 0.03, 0.022)
K = Intrinsics(600.0, 600.0, 319.5, 239.5, 640, 480)


def pose(rotation_vector_deg, position_m):
    transform = np.eye(4)
    transform[:3, :3] = cv2.Rodrigues(np.radians(np.array(rotation_vector_deg, float)))[0]
    transform[:3, 3] = position_m
    return transform


def looking(eye_m, target_m):
    forward = np.subtract(target_m, eye_m) / np.linalg.norm(np.subtract(target_m, eye_m))
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    transform = np.eye(4)
    transform[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    transform[:3, 3] = eye_m
    return transform


def hands(count, tilt_deg=25.0, seed=0):
    """Poses of a hand that points down at about (0.4, 0, 0.4)."""
    random = np.random.default_rng(seed)
    down = pose((180, 0, 0), (0, 0, 0))
    for _ in range(count):
        moved = pose(random.uniform(-tilt_deg, tilt_deg, 3), random.uniform((0.35, -0.08, 0.35), (0.45, 0.08, 0.45)))
        yield moved @ down


def corners_px(camera_to_world, board_to_world):
    in_camera = np.linalg.inv(camera_to_world) @ board_to_world
    points = BOARD.corners_m @ in_camera[:3, :3].T + in_camera[:3, 3]
    return points[:, :2] / points[:, 2:] * 600 + (319.5, 239.5)


FIXED = {"front": looking((0.9, 0.3, 0.8), (0.4, 0, 0.4)), "left": looking((0.4, 0.7, 0.8), (0.4, 0, 0.4))}
IN_THE_HAND = pose((3, -5, 88), (0.05, 0.01, -0.06))
# The board's front faces away from the fingers towards the cameras, or lies on the table below the hand.
HELD, LYING = pose((180, 0, 0), (-0.07, 0.1, 0.03)), pose((0, 0, 20), (0.35, -0.1, 0.0))


def sightings(carried, noise_px=0.15, arm_m=0.0, tilt_deg=25.0, count=12):
    random = np.random.default_rng(1)
    for hand in hands(count, tilt_deg):
        for name, fixed in {"wrist": None}.items() if carried else FIXED.items():
            camera = hand @ IN_THE_HAND if carried else fixed
            seen_px = corners_px(camera, LYING if carried else hand @ HELD)
            said = hand.copy()
            said[:3, 3] += random.normal(0, arm_m, 3)
            yield Sighting(name, said, BOARD.corners_m, seen_px + random.normal(0, noise_px, seen_px.shape))


def off(found, true):
    turn = cv2.Rodrigues(found[:3, :3].T @ true[:3, :3])[0]
    return np.linalg.norm(found[:3, 3] - true[:3, 3]), np.degrees(np.linalg.norm(turn))


@pytest.mark.parametrize("carried", [False, True])
def test_every_camera_is_found_by_one_fit(carried):
    true = {"wrist": IN_THE_HAND} if carried else FIXED
    found = fit_cameras(list(sightings(carried)), dict.fromkeys(true, K), carried=carried)
    for name, mount in true.items():
        meters, degrees = off(found[name].mount, mount)
        assert meters < 0.001, (name, meters)
        assert degrees < 0.1, (name, degrees)
        assert found[name].rms_px == pytest.approx(0.15 * np.sqrt(2), rel=0.2)
        assert found[name].advice == ""


def test_an_arm_that_is_off_is_said():
    found = fit_cameras(list(sightings(carried=True, arm_m=0.006)), {"wrist": K}, carried=True)
    assert found["wrist"].off_m > 0.003
    assert found["wrist"].advice


@pytest.mark.parametrize(
    ("changes", "words"), [({"count": 4}, "saw the board clearly at 4 poses"), ({"tilt_deg": 3.0}, "rotated by about")]
)
def test_what_gives_no_pose_is_refused_by_camera(changes, words):
    with pytest.raises(InvalidInputError, match=rf"^cameras\[wrist\]: .*{words}"):
        fit_cameras(list(sightings(carried=True, **changes)), {"wrist": K}, carried=True)


FINER = 4  # than a pixel: what is drawn is averaged, as a sensor does


class Sees:
    """A camera before which a board is drawn where arm and truth put it."""

    def __init__(self, arm, board_to_camera):
        self.arm, self.board_to_camera, self.random = arm, board_to_camera, np.random.default_rng(0)
        texture = BOARD.picture()
        self.texture = cv2.resize(texture, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
        px_of_m = self.texture.shape[1] / (BOARD.size_m[0] + BOARD.square_m)
        rim_m = BOARD.square_m / 2
        half = 0.5 / px_of_m  # pixel centers are whole numbers
        left, top = half - rim_m, BOARD.size_m[1] + rim_m - half
        self.to_m = np.array([[1 / px_of_m, 0, left], [0, -1 / px_of_m, top], [0, 0, 1]])

    def read(self):
        seen = self.board_to_camera(self.arm.hand_to_world())
        matrix = np.array([[600, 0, 319.5], [0, 600, 239.5], [0, 0, 1]])
        homography = matrix @ seen[:3, [0, 1, 3]] @ self.to_m
        finer = np.array([[FINER, 0, (FINER - 1) / 2], [0, FINER, (FINER - 1) / 2], [0, 0, 1]])
        drawn = cv2.warpPerspective(self.texture, finer @ homography, (640 * FINER, 480 * FINER), borderValue=90)
        picture = cv2.resize(drawn, (640, 480), interpolation=cv2.INTER_AREA)
        rgb = np.repeat(picture[..., None], 3, axis=2).astype(float) + self.random.normal(0, 2, (480, 640, 3))
        return Picture(rgb.clip(0, 255).astype(np.uint8), None, K, time.time())

    def close(self):
        pass


@pytest.fixture
def cell(tmp_path, monkeypatch):
    """A cell's file with cameras whose poses are not known, and the arm that it opens."""
    camera = {"driver": "my_cell:camera"}
    cameras = [{"name": name, **camera, "camera_to_world": None} for name in FIXED]
    document = {"arm": "franka", "cameras": [*cameras, {"name": "wrist", **camera, "camera_to_hand": None}]}
    (tmp_path / "cell.json").write_text(json.dumps(document))
    arm = Arm(Plain(Body()), limits=MotionLimits(Box((0.1, -0.5, 0.1), (0.9, 0.5, 0.8))))
    start = next(hands(1, tilt_deg=0.0))
    arm.go_to(Pose(tuple(start[:3, 3]), (1.0, 0.0, 0.0, 0.0)))
    world = {name: Sees(arm, lambda hand, at=at: np.linalg.inv(at) @ hand @ HELD) for name, at in FIXED.items()}
    carried = Sees(arm, lambda hand: np.linalg.inv(hand @ IN_THE_HAND) @ LYING)
    arm.cameras = Rig([*(MountedCamera(*item) for item in world.items()), MountedCamera("wrist", carried, True)])
    monkeypatch.setattr("roboprompt_client.commands.shared.open_robot", lambda name: arm)
    monkeypatch.setattr("roboprompt_client.commands.calibrate.SETTLE_S", 0.0)
    return tmp_path / "cell.json"


def run(monkeypatch, cell, *more, answer):
    board = ["--square", "0.03", "--marker", "0.022"]
    return type_command(monkeypatch, "calibrate", "--robot", cell, *board, *more, answers=[answer] * 99)[0]


@pytest.mark.parametrize("carried", [False, True])
def test_the_command_moves_the_hand_and_writes_the_cell_s_file(cell, monkeypatch, capsys, carried):
    status = run(monkeypatch, cell, *(["--carried"] if carried else []), answer="y")
    said = capsys.readouterr().out
    assert status == 0, said
    written = {camera["name"]: camera for camera in json.loads(cell.read_text())["cameras"]}
    field = "camera_to_hand" if carried else "camera_to_world"
    for name, true in ({"wrist": IN_THE_HAND} if carried else FIXED).items():
        meters, degrees = off(np.array(written[name][field]), true)
        assert meters < 0.003, (name, meters)
        assert degrees < 0.3, (name, degrees)
    assert written["front" if carried else "wrist"]["camera_to_world" if carried else "camera_to_hand"] is None
    assert "nothing: good" in said


def test_nothing_is_moved_or_written_without_a_yes(cell, monkeypatch, capsys):
    before = cell.read_bytes()
    assert run(monkeypatch, cell, answer="n") == 1
    assert "did not see the board" in capsys.readouterr().err
    assert cell.read_bytes() == before
