"""A dataset that names files of the machine that imports it used to have them uploaded."""

import json
import os

import av
import cv2
import h5py
import numpy as np
import pytest

from app.datasets.bounds import Budget, DamagedError, DatasetError
from app.datasets.formats import open_dataset
from app.datasets.lerobot import Info, Place, first_image
from app.datasets.lerobot_writer import write_lerobot
from app.datasets.options import ImportOptions, KnownObjects
from app.datasets.parcel import ObjectEntry
from tests.datasets import peract_folder as peract
from tests.datasets.parcels import parcels
from tests.episodes import pick_trajectory

FRAMES = 5
OPTIONS = ImportOptions(instruction="x", objects=KnownObjects((ObjectEntry("drawer", (0.0, 0.0, 0.0)),)))
ELSEWHERE = "leads out of the dataset"


@pytest.fixture
def secret(tmp_path):
    """A folder beside the dataset that is none of its business."""
    folder = tmp_path / "secret"
    folder.mkdir()
    with h5py.File(folder / "secret.h5", "w") as file:
        file["x"] = np.full((FRAMES, 7), 42.0)
    (folder / "secret.bin").write_bytes(np.full((FRAMES, 7), 42.0).tobytes())
    cv2.imwrite(str(folder / "secret.png"), np.full((peract.SIDE_PX, peract.SIDE_PX, 3), 42, np.uint8))
    return folder


def external_link(obs, secret):
    obs["robot0_joint_vel"] = h5py.ExternalLink(str(secret / "secret.h5"), "/x")


def soft_link_over_an_external_one(obs, secret):
    obs.file["way"] = h5py.ExternalLink(str(secret / "secret.h5"), "/")
    obs["robot0_joint_vel"] = h5py.SoftLink("/way/x")


def soft_links_in_a_circle(obs, secret):
    obs["robot0_joint_vel"] = h5py.SoftLink("/data/demo_0/obs/other")
    obs["other"] = h5py.SoftLink("/data/demo_0/obs/robot0_joint_vel")


def external_storage(obs, secret):
    place = [(str(secret / "secret.bin"), 0, FRAMES * 56)]
    obs.create_dataset("robot0_joint_vel", shape=(FRAMES, 7), dtype="f8", external=place)


def virtual_dataset(obs, secret):
    layout = h5py.VirtualLayout((FRAMES, 7), "f8")
    layout[:] = h5py.VirtualSource(str(secret / "secret.h5"), "x", (FRAMES, 7))
    obs.create_virtual_dataset("robot0_joint_vel", layout)


def own_soft_link(obs, secret):
    obs.file["own"] = np.full((FRAMES, 7), 1.0)
    obs["robot0_joint_vel"] = h5py.SoftLink("/own")


def hdf5(tmp_path, secret, joints):
    path = tmp_path / "data.hdf5"
    with h5py.File(path, "w") as file:
        demo = file.create_group("data/demo_0")
        demo["actions"] = -np.ones((FRAMES, 7))
        obs = demo.create_group("obs")
        obs["robot0_eef_pos"] = np.zeros((FRAMES, 3))
        obs["robot0_eef_quat"] = np.tile([0, 0, 0, 1.0], (FRAMES, 1))
        joints(obs, secret)
    return path


ATTACKS = (external_link, soft_link_over_an_external_one, soft_links_in_a_circle, external_storage, virtual_dataset)


@pytest.mark.parametrize("attack", ATTACKS)
def test_hdf5_that_takes_numbers_from_elsewhere(tmp_path, secret, attack):
    (entry,) = open_dataset(hdf5(tmp_path, secret, attack), OPTIONS).entries
    with pytest.raises(DamagedError, match=r"(to|from) another file"):
        entry.read()


def test_hdf5_whose_list_of_episodes_is_elsewhere(tmp_path, secret):
    with h5py.File(tmp_path / "data.hdf5", "w") as file:
        file["data"] = h5py.ExternalLink(str(secret / "secret.h5"), "/")
    with pytest.raises(DatasetError, match="to another file"):
        open_dataset(tmp_path / "data.hdf5", OPTIONS)


def test_a_soft_link_within_the_file_is_followed(tmp_path, secret):
    (entry,) = open_dataset(hdf5(tmp_path, secret, own_soft_link), OPTIONS).entries
    assert entry.read().metadata["task"] == "data"


@pytest.fixture
def lerobot(tmp_path):
    write_lerobot(tmp_path / "set", parcels())
    return tmp_path / "set"


def change_info(lerobot, **values):
    path = lerobot / "meta/info.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))


@pytest.mark.parametrize(
    ("template", "reason"),
    [
        ("../secret/{chunk_index}{file_index}.parquet", ELSEWHERE),
        ("/etc/passwd", ELSEWHERE),
        ("data/{chunk_index.__class__}/{file_index}", ELSEWHERE + "|No such file"),
        ("data/{secret}/{file_index}", "has other places than"),
        ("data/{chunk_index:>999999999}{file_index}", "No such file"),
        ("data\0{chunk_index}", "is no path"),
    ],
)
def test_lerobot_templates_that_lead_elsewhere(lerobot, template, reason):
    change_info(lerobot, data_path=template)
    with pytest.raises(DatasetError, match=reason):
        open_dataset(lerobot, OPTIONS).entries[0].read()


def test_lerobot_file_that_is_a_link(lerobot, tmp_path, secret):
    (file,) = (lerobot / "data").rglob("*.parquet")
    file.rename(secret / "rows.parquet")
    file.symlink_to(secret / "rows.parquet")
    with pytest.raises(DatasetError, match=ELSEWHERE):
        open_dataset(lerobot, OPTIONS)


def test_lerobot_scene_with_a_link(lerobot, secret):
    picture = next((lerobot / "meta/roboprompt").rglob("rgb_*"))
    picture.unlink()
    picture.symlink_to(secret / "secret.png")
    with pytest.raises(DamagedError, match=ELSEWHERE):
        open_dataset(lerobot, OPTIONS).entries[0].read()


def test_a_snapshot_of_hugging_faces_cache_is_read_with_its_links(tmp_path):
    """There every file is a link to `blobs` beside the snapshots."""
    repository = tmp_path / "datasets--lab--pick"
    snapshot, blobs = repository / "snapshots/0123", repository / "blobs"
    snapshot.parent.mkdir(parents=True)
    write_lerobot(snapshot, parcels())
    blobs.mkdir()
    for number, file in enumerate(path for path in snapshot.rglob("*") if path.is_file()):
        file.rename(blobs / str(number))
        file.symlink_to(os.path.relpath(blobs / str(number), file.parent))
    assert open_dataset(snapshot, ImportOptions()).entries[0].read().metadata["task"]


@pytest.mark.parametrize(
    "file", ["front_rgb/0.png", "front_mask/0.png", "low_dim_obs.pkl", "variation_descriptions.pkl"]
)
def test_rlbench_file_that_is_a_link(tmp_path, secret, file):
    episode = tmp_path / "set/episodes/episode0"
    peract.write_episode(episode, pick_trajectory(peract.DRAWER_M))
    (episode / file).rename(secret / "moved")
    (episode / file).symlink_to(secret / "moved")
    options = ImportOptions(objects=OPTIONS.objects)
    with pytest.raises(DamagedError, match=ELSEWHERE):
        open_dataset(tmp_path / "set", options).entries[0].read()


def test_a_pipe_is_no_file(tmp_path):
    """Reading it would wait for ever."""
    episode = tmp_path / "set/episodes/episode0"
    peract.write_episode(episode, pick_trajectory(peract.DRAWER_M))
    (episode / "front_rgb/0.png").unlink()
    os.mkfifo(episode / "front_rgb/0.png")
    with pytest.raises(DamagedError, match="is not a regular file"):
        open_dataset(tmp_path / "set", OPTIONS).entries[0].read()


PLAYLISTS = {
    "concat": "ffconcat version 1.0\nfile secret.mp4\n",
    "hls": "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nsecret.mp4\n#EXT-X-ENDLIST\n",
}


@pytest.mark.parametrize("kind", PLAYLISTS)
def test_a_video_that_is_a_list_of_other_files(tmp_path, kind):
    """FFmpeg looks at the content, whatever the name says, and would play what the list names."""
    with av.open(str(tmp_path / "secret.mp4"), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height = 64, 48
        container.mux(stream.encode(av.VideoFrame.from_ndarray(np.full((48, 64, 3), 42, np.uint8))))
        container.mux(stream.encode())
    info = Info(tmp_path, 10.0, {"seen": {"dtype": "video"}}, "", "{video_key}.mp4")
    row = {"videos/seen/chunk_index": 0, "videos/seen/file_index": 0, "videos/seen/from_timestamp": 0.0}
    place = Place(0, 1, None, tmp_path, 0, row)
    (tmp_path / "seen.mp4").write_text(PLAYLISTS[kind])
    with pytest.raises(DamagedError, match=r"seen\.mp4: cannot be decoded"):
        first_image(info, place, Budget(tmp_path), "seen")
    (tmp_path / "seen.mp4").write_bytes((tmp_path / "secret.mp4").read_bytes())
    assert first_image(info, place, Budget(tmp_path), "seen").startswith(b"\x89PNG")
