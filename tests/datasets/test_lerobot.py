import json
import sys
from dataclasses import replace

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from app.datasets.apart import open_dataset
from app.datasets.bounds import DamagedError, DatasetError, MissingPackageError
from app.datasets.lerobot.writer import write_lerobot
from app.datasets.options import ImportOptions, KnownObjects
from app.datasets.parcel import ObjectEntry
from app.perception.images import decode_rgb
from app.untrusted_arrays import film_from_npz, trajectory_from_npz
from roboprompt_client.types.trajectory import Trajectory, npz_from_trajectory
from tests.datasets.parcels import PLACES_M, parcel, parcels
from tests.episodes import camera, film_npz, jpeg, png

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
FRONT = {**camera(width=64, height=48), "rgb": "observation.images.front"}


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


def with_films(parcel, **films):
    return replace(parcel, files={**parcel.files, **films})


TIMES_S = (0.003, 0.2, 0.45, 0.9)  # of a recording that begins at 0.003 s and has a row each 0.05 s
ODD = film_npz(TIMES_S, [jpeg(number, 65, 49) for number in range(4)])


def test_films_are_videos_with_a_picture_for_each_row(tmp_path):
    sent = [with_films(parcel(place_m), film_front=ODD, film_wrist=film_npz(TIMES_S)) for place_m in PLACES_M[:2]]
    said = []
    write_lerobot(tmp_path / "set", [*sent, with_films(parcel(PLACES_M[2]), film_front=ODD)], said.append)
    assert said == ["no video of wrist: not every episode has a film of that camera, of one size"]
    info = json.loads((tmp_path / "set/meta/info.json").read_text())
    key = "observation.images.front"
    assert [name for name, item in info["features"].items() if item["dtype"] == "video"] == [key]
    assert info["features"][key]["shape"] == [48, 64, 3]
    (rows,) = (tmp_path / "set/meta/episodes").glob("*/*.parquet")
    for row in pq.read_table(rows).to_pylist():
        place = {name: row[f"videos/{key}/{name}_index"] for name in ("chunk", "file")}
        path = info["video_path"].format(video_key=key, chunk_index=place["chunk"], file_index=place["file"])
        with av.open(str(tmp_path / "set" / path)) as container:
            pictures = list(container.decode(video=0))
        assert [picture.time for picture in pictures] == pytest.approx(np.arange(row["length"]) / 20, abs=1e-4)
        shades = [round(picture.to_ndarray(format="rgb24").mean() / 40) for picture in pictures]
        assert shades == [0] * 4 + [1] * 5 + [2] * 9 + [3] * 3
        assert row[f"videos/{key}/to_timestamp"] == pytest.approx(row["length"] / 20)
        assert np.shape(row[f"stats/{key}/mean"]) == (3, 1, 1)
    stats = json.loads((tmp_path / "set/meta/stats.json").read_text())[key]
    assert np.shape(stats["std"]) == (3, 1, 1)
    assert (np.min(stats["min"]), np.max(stats["max"])) == (0, pytest.approx(120 / 255, abs=0.01))


def test_films_come_back_as_they_were_uploaded(tmp_path):
    sent = with_films(parcel(), film_front=ODD, film_wrist=film_npz([0.5]))
    write_lerobot(tmp_path / "set", [sent])
    (entry,) = open_dataset(tmp_path / "set", ImportOptions()).entries
    assert entry.read().files == sent.files
    assert entry.read().key == sent.key


def test_without_av_a_dataset_has_no_videos(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    said = []
    write_lerobot(tmp_path / "set", [with_films(parcel(), film_front=ODD)], said.append)
    assert "no video of front: videos of LeRobot datasets need" in said[0]
    assert json.loads((tmp_path / "set/meta/info.json").read_text())["video_path"] is None


def test_a_film_of_what_is_no_picture_is_left_out(tmp_path):
    damaged = film_npz([0.1, 0.2], [b"\xff\xd8\xff no picture \xff\xd9", jpeg()])
    said = []
    write_lerobot(tmp_path / "set", [with_films(parcel(), film_front=film) for film in (ODD, damaged)], said.append)
    assert said == ["no video of front: not every episode has a film of that camera, of one size"]


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
        "observation.images.front": [{"bytes": image, "path": None}] * length,
        "episode_index": np.full(length, index),
        "index": np.arange(length) + sum(LENGTHS[:index]),
    }


def features(image="image"):
    kinds = {
        "observation.state": ("float32", [8]),
        "observation.pose": ("float64", [6]),
        "action": ("float32", [1]),
        "observation.images.front": (image, [48, 64, 3]),
        "episode_index": ("int64", [1]),
        "index": ("int64", [1]),
    }
    return {name: {"dtype": dtype, "shape": shape, "names": None} for name, (dtype, shape) in kinds.items()}


def write_info(root, version, **paths):
    (root / "meta").mkdir(parents=True)
    info = {"codebase_version": version, "fps": FPS, "chunks_size": 1000, "features": features(), **paths}
    (root / "meta/info.json").write_text(json.dumps(info))


def write_3(root):
    """Two episodes in one file, as v3.0 keeps them."""
    write_info(root, "v3.0", data_path="data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", video_path=None)
    tables = [pa.table(frames(length, index)) for index, length in enumerate(LENGTHS)]
    (root / "data/chunk-000").mkdir(parents=True)
    pq.write_table(pa.concat_tables(tables), root / "data/chunk-000/file-000.parquet")
    rows = [
        {
            "episode_index": index,
            "tasks": [f"do {index}"],
            "length": length,
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": sum(LENGTHS[:index]),
            "dataset_to_index": sum(LENGTHS[: index + 1]),
            "stats/action/min": [0.0],
        }
        for index, length in enumerate(LENGTHS)
    ]
    (root / "meta/episodes/chunk-000").mkdir(parents=True)
    pq.write_table(pa.Table.from_pylist(rows), root / "meta/episodes/chunk-000/file-000.parquet")


def write_2(root):
    """The same two episodes, each in a file of its own."""
    path = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    write_info(root, "v2.1", data_path=path, video_path=None)
    (root / "data/chunk-000").mkdir(parents=True)
    lines = []
    for index, length in enumerate(LENGTHS):
        pq.write_table(pa.table(frames(length, index)), root / f"data/chunk-000/episode_{index:06d}.parquet")
        lines.append(json.dumps({"episode_index": index, "tasks": [f"do {index}"], "length": length}))
    (root / "meta/episodes.jsonl").write_text("\n".join(lines) + "\n")


@pytest.fixture(params=[write_3, write_2])
def foreign(request, tmp_path):
    request.param(tmp_path / "their set")
    return tmp_path / "their set"


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


def test_a_damaged_file_is_named_and_the_others_are_read(tmp_path):
    write_2(tmp_path)
    (tmp_path / "data/chunk-000/episode_000000.parquet").write_bytes(b"PAR1 and no more")
    first, second = open_dataset(tmp_path, options()).entries
    with pytest.raises(DamagedError, match=r"episode_000000\.parquet: cannot be read"):
        first.read()
    assert second.read().metadata["instruction"] == "do 1"


def test_versions_and_descriptions_that_cannot_be_read(tmp_path):
    write_3(tmp_path)
    info = json.loads((tmp_path / "meta/info.json").read_text())
    (tmp_path / "meta/info.json").write_text(json.dumps({**info, "codebase_version": "v1.6"}))
    with pytest.raises(DatasetError, match=r"version v1\.6"):
        open_dataset(tmp_path, options())
    (tmp_path / "meta/info.json").write_text("{")
    with pytest.raises(DatasetError, match=r"info\.json: cannot be read"):
        open_dataset(tmp_path, options())


@pytest.fixture
def filmed(tmp_path):
    write_2(tmp_path)
    video = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4"
    info = json.loads((tmp_path / "meta/info.json").read_text())
    (tmp_path / "meta/info.json").write_text(json.dumps({**info, "features": features("video"), "video_path": video}))
    for index, length in enumerate(LENGTHS):
        path = tmp_path / f"videos/chunk-000/observation.images.front/episode_{index:06d}.mp4"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_clip(path, [60 + 100 * index] + [10] * (length - 1))
    return tmp_path


def write_clip(path, shades):
    """A video of frames of one shade each."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=FPS)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for shade in shades:
            picture = av.VideoFrame.from_ndarray(np.full((48, 64, 3), shade, np.uint8), format="rgb24")
            container.mux(stream.encode(picture))
        container.mux(stream.encode())


def test_the_first_picture_of_a_video(filmed):
    read = [entry.read() for entry in open_dataset(filmed, options(cameras=[FRONT])).entries]
    for item, shade in zip(read, (60, 160), strict=True):
        np.testing.assert_allclose(decode_rgb("rgb", item.files["rgb_front"]), shade, atol=6)


def test_videos_become_films(filmed):
    """Ten pictures a second, of which every second is kept."""
    for entry, length, shade in zip(open_dataset(filmed, options()).entries, LENGTHS, (60, 160), strict=True):
        read = entry.read()
        assert sorted(read.files) == ["film_front", "trajectory"]
        film = film_from_npz("front", read.files["film_front"])
        assert film.times_s.tolist() == pytest.approx(np.arange(0, length, 2) / FPS)
        first, second = (decode_rgb("film", picture) for picture in film.pictures[:2])
        np.testing.assert_allclose(first, shade, atol=6)
        np.testing.assert_allclose(second, 10, atol=8)
        assert read.notes[-1] == "calibration of observation.images.front: images are left out"
    assert replace(read, files={"trajectory": read.files["trajectory"]}).key == read.key
    (entry, _) = open_dataset(filmed, replace(options(), cameras=("side",))).entries
    assert list(entry.read().files) == ["trajectory"]


def test_a_video_that_cannot_be_read_costs_only_the_film(filmed, monkeypatch):
    (filmed / "videos/chunk-000/observation.images.front/episode_000000.mp4").write_bytes(b"no video")
    first, second = (entry.read() for entry in open_dataset(filmed, options()).entries)
    assert "episode_000000.mp4: cannot be decoded" in first.notes[-1]
    assert list(first.files) == ["trajectory"]
    assert "film_front" in second.files
    monkeypatch.setitem(sys.modules, "av", None)
    without = open_dataset(filmed, options()).entries[1].read()
    assert "film of observation.images.front: videos of LeRobot datasets need" in without.notes[-1]


def test_a_dataset_that_does_not_say_where_its_videos_are(tmp_path):
    write_3(tmp_path)
    info = json.loads((tmp_path / "meta/info.json").read_text())
    video = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
    for path, why in ((video, "does not say where"), (None, "names no video_path")):
        changed = {**info, "features": features("video"), "video_path": path}
        (tmp_path / "meta/info.json").write_text(json.dumps(changed))
        read = open_dataset(tmp_path, options()).entries[0].read()
        assert list(read.files) == ["trajectory"]
        assert why in read.notes[-1]


def test_videos_say_what_they_need(filmed, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingPackageError, match="pip install av"):
        open_dataset(filmed, options(cameras=[FRONT])).entries[0].read()


def test_parquet_says_what_it_needs(tmp_path, monkeypatch):
    write_3(tmp_path)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingPackageError, match="pip install pyarrow"):
        open_dataset(tmp_path, options())
