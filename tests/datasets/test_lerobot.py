import json
import sys
from dataclasses import replace

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from app.datasets.bounds import DamagedError, DatasetError
from app.datasets.formats import open_dataset
from app.datasets.lerobot_writer import write_lerobot
from app.datasets.options import ImportOptions, KnownObjects
from app.datasets.parcel import ObjectEntry
from app.perception.images import decode_rgb
from app.untrusted_arrays import trajectory_from_npz
from roboprompt_client.types.trajectory import Trajectory, npz_from_trajectory
from tests.datasets.parcels import parcel, parcels
from tests.episodes import camera, png

FPS = 10
LENGTHS = (6, 9)
CUBE = KnownObjects((ObjectEntry("cube", (0.1, 0.0, 0.8)),))
ARM = {
    "joint_positions": "observation.state[0:7]",
    "end_effector_positions": "observation.pose[0:3]",
    "end_effector_rotations": "observation.pose[3:6]",
    "rotation_format": "rotation_vector",
    "gripper": "action",
    "gripper_open_above": 0.5,
}
IMAGES = "observation.images.front"
FRONT = {**camera(width=64, height=48), "rgb": IMAGES}


def test_export_and_import_give_the_same_episodes(tmp_path):
    sent = parcels()
    assert write_lerobot(tmp_path / "set", sent) == len(sent)
    dataset = open_dataset(tmp_path / "set", ImportOptions())
    assert dataset.format == "LeRobot v3.0"
    for before, entry in zip(sent, dataset.entries, strict=True):
        after = entry.read()
        assert after.files == before.files
        assert after.metadata == before.metadata
        assert after.key == before.key


def test_an_arm_that_does_not_say_its_joints_comes_back(tmp_path):
    alone = parcel(everything=False)
    hand = trajectory_from_npz(alone.files["trajectory"])
    jointless = Trajectory.from_poses(hand.positions_m, hand.quaternions_xyzw, hand.gripper_open)
    sent = replace(alone, files={**alone.files, "trajectory": npz_from_trajectory(jointless)})
    write_lerobot(tmp_path / "set", [sent])
    (entry,) = open_dataset(tmp_path / "set", ImportOptions()).entries
    assert entry.read().key == sent.key


def test_columns_that_not_all_episodes_have_are_left_out(tmp_path):
    write_lerobot(tmp_path / "set", [parcel(), parcel(everything=False)])
    first, second = (entry.read() for entry in open_dataset(tmp_path / "set", ImportOptions()).entries)
    assert trajectory_from_npz(first.files["trajectory"]).joint_positions_rad is None
    assert first.files["rgb_front"] == second.files["rgb_front"]


def test_what_policies_train_on(tmp_path):
    write_lerobot(tmp_path / "set", parcels())
    table = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")
    state, action = (np.array(table.column(name).to_pylist()) for name in ("observation.state", "action"))
    frames = len(state) // 3
    np.testing.assert_array_equal(action[: frames - 1], state[1:frames])
    np.testing.assert_array_equal(action[frames - 1], state[frames - 1])
    stats = json.loads((tmp_path / "set/meta/stats.json").read_text())
    np.testing.assert_allclose(stats["action"]["mean"], action.mean(axis=0), rtol=1e-6)
    assert stats["action"]["count"] == [3 * frames]


def test_measured_rates_near_one_whole_number_are_exported(tmp_path):
    measured = [parcel(), parcel()]
    for item, rate_hz in zip(measured, (19.93, 20.21), strict=True):
        item.metadata["control_frequency_hz"] = rate_hz
    write_lerobot(tmp_path / "set", measured)
    assert json.loads((tmp_path / "set/meta/info.json").read_text())["fps"] == 20
    read = [entry.read() for entry in open_dataset(tmp_path / "set", ImportOptions()).entries]
    assert [item.key for item in read] == [item.key for item in measured]


def test_nothing_is_overwritten_or_half_written(tmp_path):
    with pytest.raises(DatasetError, match="no episodes"):
        write_lerobot(tmp_path / "set", [])
    slow = parcel()
    slow.metadata["control_frequency_hz"] = 12.5
    with pytest.raises(DatasetError, match=r"these have 12\.5"):
        write_lerobot(tmp_path / "set", [slow])
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "set").mkdir()
    with pytest.raises(DatasetError, match="exists"):
        write_lerobot(tmp_path / "set", parcels())


def frames(length, index):
    """Columns of somebody else's dataset: no velocities, rotation vectors, a scalar gripper, an image."""
    t = np.arange(length) / FPS
    pose = np.column_stack([t, t, t, np.zeros((length, 2)), t])
    image = png(np.full((48, 64, 3), 40 * (index + 1), np.uint8))
    return {
        "observation.state": np.column_stack([np.outer(t, np.ones(7)), t]).astype(np.float32).tolist(),
        "observation.pose": pose.tolist(),
        "action": (t < 0.3).astype(np.float32),
        IMAGES: [{"bytes": image, "path": None}] * length,
        "episode_index": np.full(length, index),
        "index": np.arange(length) + sum(LENGTHS[:index]),
    }


def features(image="image"):
    kinds = {
        "observation.state": ("float32", [8]),
        "observation.pose": ("float64", [6]),
        "action": ("float32", [1]),
        IMAGES: (image, [48, 64, 3]),
        "episode_index": ("int64", [1]),
        "index": ("int64", [1]),
    }
    return {name: {"dtype": dtype, "shape": shape, "names": None} for name, (dtype, shape) in kinds.items()}


@pytest.fixture
def foreign(tmp_path):
    """Two episodes in one file."""
    root = tmp_path / "their set"
    (root / "meta/episodes/chunk-000").mkdir(parents=True)
    data = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
    info = {"codebase_version": "v3.0", "fps": FPS, "features": features(), "data_path": data, "video_path": None}
    (root / "meta/info.json").write_text(json.dumps(info))
    (root / "data/chunk-000").mkdir(parents=True)
    tables = [pa.table(frames(length, index)) for index, length in enumerate(LENGTHS)]
    pq.write_table(pa.concat_tables(tables), root / "data/chunk-000/file-000.parquet")
    rows = [
        {
            "episode_index": index,
            "tasks": [f"do {index}"],
            "length": length,
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": sum(LENGTHS[:index]),
            f"videos/{IMAGES}/chunk_index": 0,
            f"videos/{IMAGES}/file_index": 0,
            f"videos/{IMAGES}/from_timestamp": sum(LENGTHS[:index]) / FPS,
            "stats/action/min": [0.0],
        }
        for index, length in enumerate(LENGTHS)
    ]
    pq.write_table(pa.Table.from_pylist(rows), root / "meta/episodes/chunk-000/file-000.parquet")
    return root


def change_info(root, **changes):
    path = root / "meta/info.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def options(**wishes):
    return ImportOptions(objects=CUBE, features={**ARM, **wishes})


def test_somebody_elses_dataset(foreign):
    read = [entry.read() for entry in open_dataset(foreign, options(cameras=[FRONT])).entries]
    assert [item.metadata["instruction"] for item in read] == ["do 0", "do 1"]
    assert read[0].metadata["task"] == "their set"
    assert read[0].metadata["control_frequency_hz"] == FPS
    assert read[0].metadata["objects"] == [{"name": "cube", "position": [0.1, 0.0, 0.8]}]
    assert read[0].notes == ("joint velocities: derived from joint positions",)
    for index, (item, length) in enumerate(zip(read, LENGTHS, strict=True)):
        trajectory = trajectory_from_npz(item.files["trajectory"])
        assert len(trajectory) == length
        np.testing.assert_allclose(trajectory.joint_velocities_rad_s, 1.0, rtol=1e-5)
        assert trajectory.gripper_open.tolist() == [True] * 3 + [False] * (length - 3)
        assert (decode_rgb("rgb", item.files["rgb_front"]) == 40 * (index + 1)).all()


def test_images_without_calibration_are_left_out_with_a_note(foreign):
    read = open_dataset(foreign, options()).entries[0].read()
    assert list(read.files) == ["trajectory"]
    assert "calibration of observation.images.front: images are left out" in read.notes


def test_versions_and_descriptions_that_cannot_be_read(foreign):
    change_info(foreign, codebase_version="v2.1")
    with pytest.raises(DatasetError, match=r"version v2\.1, can be read: v3\.0"):
        open_dataset(foreign, options())
    (foreign / "meta/info.json").write_text("{")
    with pytest.raises(DatasetError, match=r"info\.json: cannot be read"):
        open_dataset(foreign, options())


@pytest.fixture
def filmed(foreign):
    """The same with a video of both episodes instead of embedded images."""
    change_info(foreign, features=features("video"), video_path="{video_key}-{chunk_index}-{file_index}.mp4")
    with av.open(str(foreign / f"{IMAGES}-0-0.mp4"), "w") as container:
        stream = container.add_stream("mpeg4", rate=FPS)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for shade in [60] + [10] * (LENGTHS[0] - 1) + [160] + [10] * (LENGTHS[1] - 1):
            picture = av.VideoFrame.from_ndarray(np.full((48, 64, 3), shade, np.uint8), format="rgb24")
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return foreign


def test_the_first_picture_of_a_video(filmed):
    read = [entry.read() for entry in open_dataset(filmed, options(cameras=[FRONT])).entries]
    for item, shade in zip(read, (60, 160), strict=True):
        np.testing.assert_allclose(decode_rgb("rgb", item.files["rgb_front"]), shade, atol=6)


def test_a_video_that_cannot_be_read_is_named(filmed, monkeypatch):
    (filmed / f"{IMAGES}-0-0.mp4").write_bytes(b"no video")
    (entry, _) = open_dataset(filmed, options(cameras=[FRONT])).entries
    with pytest.raises(DamagedError, match=r"mp4: cannot be decoded"):
        entry.read()
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(ModuleNotFoundError, match="av"):
        entry.read()


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"video_path": None}, "names no video_path"),
        ({"features": features("video") | {"side": {"dtype": "video"}}}, "does not say where side is"),
    ],
)
def test_a_dataset_that_does_not_say_where_its_videos_are(filmed, changes, why):
    change_info(filmed, **changes)
    front = {**FRONT, "rgb": "side" if "features" in changes else IMAGES}
    with pytest.raises(DamagedError, match=why):
        open_dataset(filmed, options(cameras=[front])).entries[0].read()


def test_parquet_says_what_it_needs(foreign, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ModuleNotFoundError, match="pyarrow"):
        open_dataset(foreign, options())
