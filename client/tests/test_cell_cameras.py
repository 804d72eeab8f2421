"""The cell's cameras: drivers, what is wrong with a picture, poses."""

import json
import time
from dataclasses import replace

import numpy as np
import pytest
from makers import Body, Plain

from roboprompt_client.arms.arm import Arm
from roboprompt_client.cameras.rig import Intrinsics, MountedCamera, Picture, Rig
from roboprompt_client.cameras.table import Table
from roboprompt_client.cell import open_robot, rig_from_json
from roboprompt_client.errors import CameraError, InvalidInputError
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.robot import Observation
from roboprompt_client.types.camera import checked_camera_pose

cv2 = pytest.importorskip("cv2", reason="the extra `images` is not installed")
K = Intrinsics(60.0, 60.0, 31.5, 23.5, 64, 48)
K_JSON = {"fx": 60, "fy": 60, "cx": 31.5, "cy": 23.5, "width": 64, "height": 48}
MOUNT = np.array([[1.0, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, -1, 1.0], [0, 0, 0, 1]])


class Sensor:
    """Pictures with the noise of a sensor; `change` spoils them."""

    def __init__(self, change=lambda picture: picture, **_):
        self.change, self.random, self.closed = change, np.random.default_rng(0), False

    def read(self):
        rgb = self.random.integers(0, 255, (48, 64, 3), dtype=np.uint8)
        return self.change(Picture(rgb, np.full((48, 64), 0.8, np.float32), K, time.time()))

    def close(self):
        self.closed = True


def rig(*changes, mount=MOUNT, in_hand=False):
    return Rig(MountedCamera(f"cam{k}", Sensor(change), in_hand, mount) for k, change in enumerate(changes))


def same(picture):
    return picture


def look_often(rig, times):
    for _ in range(times):
        rig.frames()


def test_pictures_become_calibrated_frames():
    first, second = rig(same, same).frames()
    assert (first.camera.name, second.camera.name) == ("cam0", "cam1")
    assert first.camera.image_size_px == (64, 48)
    np.testing.assert_array_equal(first.camera.camera_to_world, MOUNT)


def without_depth(share):
    depth_m = np.full((48, 64), 0.8, np.float32)
    depth_m[: round(48 * share)] = 0
    return lambda picture: replace(picture, depth_m=depth_m)


FROZEN = Picture(np.zeros((48, 64, 3), np.uint8), None, K, 0.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda picture: replace(FROZEN, taken_s=time.time()), "its picture is frozen"),
        (without_depth(0.75), "the depth of 75% of its pixels is unknown"),
        (lambda picture: replace(picture, taken_s=time.time() - 2), "taken 2.00 s before it was asked for"),
        (lambda picture: replace(picture, taken_s=time.time() + 2), "its clock is 2.00 s ahead"),
    ],
)
def test_a_picture_that_cannot_be_used_names_its_camera(change, words):
    cameras = rig(same, change)
    with pytest.raises(CameraError, match=f"camera 'cam1': .*{words}"):
        look_often(cameras, 2)


def test_a_camera_without_a_pose_is_named():
    with pytest.raises(InvalidInputError, match=r"cameras\[cam0\].camera_to_world: is not known"):
        rig(same, mount=None).frames()


def write_frame(folder, name, value, depth=True):
    rgb = np.zeros((48, 64, 3), np.uint8)
    rgb[..., 0] = value
    if depth:
        cv2.imwrite(str(folder / f"{name}_depth.png"), np.full((48, 64), 700 + value, np.uint16))
    cv2.imwrite(str(folder / f"{name}_color.png"), rgb[..., ::-1])


@pytest.fixture
def folder(tmp_path):
    frames = tmp_path / "frames"
    frames.mkdir()
    (frames / "camera.json").write_text(json.dumps({"intrinsics": K_JSON, "depth_scale": 0.0005}))
    return frames


def cell(**changes):
    camera = {"name": "front", "driver": "files", "options": {"folder": "frames"}, "camera_to_world": MOUNT.tolist()}
    return [{**camera, **changes}]


def test_recorded_frames_are_read_in_their_order(folder):
    for number in (10, 20):
        write_frame(folder, f"{number:04}", number)
    options = {"folder": "frames", "recorded": True}
    cameras = rig_from_json(cell(options=options), folder.parent)
    for number in (10, 20):
        (frame,) = cameras.frames()
        assert frame.rgb[0, 0].tolist() == [number, 0, 0]
        np.testing.assert_allclose(frame.depth_m, (700 + number) * 0.0005, rtol=1e-6)
    with pytest.raises(CameraError, match=r"'front': .*no frame after 0020_color.png"):
        cameras.frames()


def test_a_live_folder_gives_no_old_frame(folder, monkeypatch):
    write_frame(folder, "0001", 10)
    monkeypatch.setattr("roboprompt_client.cameras.files.MAX_WAIT_S", 0.2)
    cameras = rig_from_json(cell(), folder.parent)
    time.sleep(0.05)
    with pytest.raises(CameraError, match="'front': no frame came into"):
        cameras.frames()


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"driver": "kinect"}, r"cameras\[front\].driver"),
        ({"driver": 5}, r"cameras\[0\]"),
        ({"camera_to_hand": None}, r"cameras\[0\]"),
        ({"fps": 30}, r"cameras\[front\].fps"),
        ({"name": "front@1"}, r"cameras\[0\].name"),
        ({"options": {"file": "x"}}, r"cameras\[front\].options"),
        ({"options": {"folder": "nowhere"}}, "folder"),
        ({"camera_to_world": [[1, 0], [0, 1]]}, r"cameras\[front\].camera_to_world"),
        ({"camera_to_world": (MOUNT @ np.diag([1, 1, -1, 1])).tolist()}, r"cameras\[front\].camera_to_world"),
    ],
)
def test_what_a_cell_s_cameras_cannot_be_is_refused_by_field(folder, changes, field):
    with pytest.raises(InvalidInputError, match=f"^{field}:"):
        rig_from_json(cell(**changes), folder.parent)


def test_one_name_twice_is_refused_and_what_was_opened_is_closed(folder):
    with pytest.raises(InvalidInputError, match="'front' appears twice"):
        rig_from_json(cell() * 2, folder.parent)


def test_a_pose_in_millimeters_is_refused_as_one():
    with pytest.raises(InvalidInputError, match="puts the camera 1025 m away: probably millimeters"):
        checked_camera_pose("camera_to_world", MOUNT * np.array([[1, 1, 1, 1000.0]] * 3 + [[1, 1, 1, 1]]))


@pytest.fixture
def arm():
    cameras = Rig([MountedCamera("wrist", Sensor(), True, MOUNT), MountedCamera("front", Sensor(), False, MOUNT)])
    limits = MotionLimits(Box((-1.0, -1.0, 0.1), (1.0, 1.0, 2.0)), hand_radius_m=0.0)
    return Arm(Plain(Body()), cameras=cameras, limits=limits)


def test_a_camera_in_the_hand_has_the_hand_s_pose(arm):
    frames = {frame.camera.name: frame for frame in arm.observe().frames}
    np.testing.assert_allclose(frames["wrist"].camera.camera_to_world, arm.hand_to_world() @ MOUNT)
    np.testing.assert_array_equal(frames["front"].camera.camera_to_world, MOUNT)


def test_the_masks_of_a_detector_of_one_s_own_come_with_the_cameras_pictures():
    masked = Observation(to_find="mug", mask_ids={"mug": [1]})
    cameras = Rig([MountedCamera("front", Sensor(), False, MOUNT)])
    arm = Arm(Plain(Body()), observe_scene=lambda: masked, cameras=cameras)
    seen = arm.observe()
    assert (seen.to_find, seen.mask_ids, len(seen.frames)) == (("mug",), {"mug": [1]}, 1)


def test_a_hand_that_moves_during_the_picture_is_named(arm):
    poses = [np.eye(4), np.eye(4)]
    poses[1][0, 3] = 0.002
    with pytest.raises(CameraError, match=r"camera 'wrist': the hand moved by 2.0 mm"):
        arm.cameras.frames(lambda: poses.pop(0))


def test_an_arm_that_cannot_be_reached_leaves_no_camera_open(tmp_path, monkeypatch):
    made = []
    monkeypatch.setattr("test_cell_cameras.Sensor.made", made, raising=False)
    cameras = [{"name": "front", "driver": "test_cell_cameras:kept", "camera_to_world": None}]
    (tmp_path / "cell.json").write_text(json.dumps({"arm": "nowhere:arm", "cameras": cameras}))
    with pytest.raises(InvalidInputError, match=r"^arm:"):
        open_robot(str(tmp_path / "cell.json"))
    assert [sensor.closed for sensor in made] == [True]


def kept():
    Sensor.made.append(Sensor())
    return Sensor.made[-1]


def test_a_cell_s_cameras_are_opened_unless_only_its_arm_is_wanted(tmp_path, monkeypatch):
    monkeypatch.setattr("test_cell_cameras.Sensor.made", [], raising=False)
    cameras = [{"name": "wrist", "driver": "test_cell_cameras:kept", "camera_to_hand": MOUNT.tolist()}]
    (tmp_path / "cell.json").write_text(json.dumps({"arm": "test_cell_cameras:arm_driver", "cameras": cameras}))
    assert open_robot(str(tmp_path / "cell.json"), cameras=False).observe().frames == ()
    (frame,) = open_robot(str(tmp_path / "cell.json")).observe().frames
    assert frame.camera.name == "wrist"


def arm_driver():
    return Plain(Body())


def test_a_camera_that_sees_the_table_elsewhere_is_not_believed(arm):
    level = np.diag([1.0, -1, -1, 1])
    level[2, 3] = 0.8
    arm.cameras = Rig([MountedCamera("front", Sensor(), False, level)])
    table = Table.seen_in(arm.observe().frames)
    np.testing.assert_allclose(table.position_m[2], 0, atol=1e-6)
    again = Table.from_json(json.loads(json.dumps(table.to_json())))
    arm.cameras = Rig(arm.cameras.cameras, again)
    assert len(arm.observe().frames) == 1
    bumped = level.copy()
    bumped[2, 3] += 0.012
    arm.cameras = Rig([MountedCamera("front", Sensor(), False, bumped)], again)
    with pytest.raises(CameraError, match=r"camera 'front': it sees the table \+12 mm and 0.0 degrees off"):
        arm.observe()
    higher = level.copy()
    higher[2, 3] += 0.3  # it looks at a shelf
    arm.cameras = Rig([MountedCamera("front", Sensor(), False, higher)], again)
    assert len(arm.observe().frames) == 1


@pytest.mark.parametrize("table", [[], {"position": [0, 0, 0], "normal": [0, 0, 2]}, {"position": [0, 0, 0]}])
def test_a_table_that_is_none_is_refused(table):
    with pytest.raises(InvalidInputError, match=r"^table"):
        Table.from_json(table)
