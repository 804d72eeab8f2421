import pickle

import numpy as np
import pytest

from app.datasets.bounds import Budget, DamagedError, DatasetError
from app.datasets.formats import open_dataset
from app.datasets.options import ImportOptions, KnownObjects
from app.datasets.parcel import ObjectEntry
from app.datasets.rlbench_pickle import load_demo
from app.perception.images import ImageBytes, decode_frame
from app.pipeline.geometry import backproject
from app.pipeline.keyframes import KeyframeRule, Motion, find_keyframes
from app.untrusted_arrays import trajectory_from_npz
from roboprompt_client.types.camera import camera_from_json
from tests.datasets import peract_folder as peract
from tests.episodes import pick_trajectory

DRAWER = ImportOptions(objects=KnownObjects((ObjectEntry("drawer", mask_ids=(peract.DRAWER_ID,)),)))


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "open_drawer/all_variations/episodes/episode0"
    peract.write_episode(folder, pick_trajectory(peract.DRAWER_M))
    return folder


def read(root, options=DRAWER):
    return [entry.read() for entry in open_dataset(root, options).entries]


def frames(parcel):
    for document in parcel.metadata["cameras"]:
        images = (parcel.files.get(f"{kind}_{document['name']}") for kind in ("rgb", "depth", "mask"))
        yield decode_frame(camera_from_json(document), ImageBytes(*images))


def test_what_an_episode_says(folder, tmp_path):
    (parcel,) = read(tmp_path)
    assert parcel.metadata["task"] == "open_drawer"
    assert parcel.metadata["instruction"] == "open the bottom drawer"
    assert parcel.metadata["control_frequency_hz"] == 20
    assert parcel.metadata["objects"] == [{"name": "drawer", "mask_ids": [98]}]
    assert parcel.metadata["extra"]["variation"] == 1
    assert parcel.notes == ()


def test_keyframes_are_those_of_the_recording(folder, tmp_path):
    (parcel,) = read(tmp_path)
    recorded, imported = pick_trajectory(peract.DRAWER_M), trajectory_from_npz(parcel.files["trajectory"])
    for rule in ("merged", "authors", "uniform"):
        assert find_keyframes(Motion.of(imported), KeyframeRule(rule)) == find_keyframes(
            Motion.of(recorded), KeyframeRule(rule)
        )
    np.testing.assert_array_equal(imported.positions_m, recorded.positions_m)
    np.testing.assert_array_equal(imported.gripper_open, recorded.gripper_open)


@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
def test_every_protocol_of_a_pickle(tmp_path, protocol):
    peract.write_episode(tmp_path / "episode0", pick_trajectory(peract.DRAWER_M), protocol=protocol)
    first = load_demo(tmp_path, tmp_path / "episode0/low_dim_obs.pkl", Budget(tmp_path))[0]
    assert first.get("gripper_pose").shape == (7,)
    assert float(first.get("ignore_collisions")) == 1.0


def test_every_camera_puts_the_object_where_it_is(folder, tmp_path):
    (parcel,) = read(tmp_path)
    seen = list(frames(parcel))
    assert [frame.camera.name for frame in seen] == sorted(peract.CAMERAS)
    for frame in seen:
        assert frame.camera.fx_px == peract.FOCAL_PX
        points_m = backproject(frame, frame.mask == peract.DRAWER_ID)
        np.testing.assert_allclose(points_m.mean(axis=0), peract.DRAWER_M, atol=0.01)  # half a pixel is 9 mm at 1.3 m
        assert set(np.unique(frame.mask)) == {peract.DRAWER_ID, peract.TABLE_ID}


def test_depth_keeps_a_tenth_of_a_millimeter(folder, tmp_path):
    (parcel,) = read(tmp_path)
    for frame in frames(parcel):
        depth_m, _, _ = peract.view(peract.default_matrices()[frame.camera.name])
        np.testing.assert_allclose(frame.depth_m, depth_m, atol=6e-5)


def test_pictures_are_sent_as_they_are(folder, tmp_path):
    (parcel,) = read(tmp_path)
    assert parcel.files["rgb_front"] == (folder / "front_rgb/0.png").read_bytes()
    images = [f"{kind}_{name}" for kind in ("depth", "mask", "rgb") for name in peract.CAMERAS]
    assert sorted(parcel.files) == sorted([*images, "trajectory"])


def test_poses_from_the_task_state(folder, tmp_path):
    (parcel,) = read(tmp_path, ImportOptions(objects=KnownObjects((ObjectEntry("drawer", low_dim_state=1),))))
    (drawer,) = parcel.metadata["objects"]
    assert drawer == {"name": "drawer", "position": peract.DRAWER_M.tolist(), "quaternion_xyzw": [0, 0, 0, 1]}
    tracked = trajectory_from_npz(parcel.files["trajectory"])
    np.testing.assert_array_equal(tracked.object_positions_m[-1], [peract.DRAWER_M])
    with pytest.raises(DamagedError, match="task_low_dim_state has 8 numbers: no pose of drawer at 2"):
        read(tmp_path, ImportOptions(objects=KnownObjects((ObjectEntry("drawer", low_dim_state=2),))))


def test_variations_below_a_task_in_the_order_of_their_numbers(tmp_path):
    for number in (10, 2):
        folder = tmp_path / f"turn_tap/variation0/episodes/episode{number}"
        peract.write_episode(folder, pick_trajectory(peract.DRAWER_M))
        (folder / "variation_descriptions.pkl").rename(folder.parent.parent / "variation_descriptions.pkl")
    entries = open_dataset(tmp_path, DRAWER).entries
    assert [entry.name.rpartition("/")[2] for entry in entries] == ["episode2", "episode10"]
    assert entries[0].read().metadata["task"] == "turn_tap"


def test_no_calibration_means_no_images(tmp_path):
    peract.write_episode(tmp_path / "episode0", pick_trajectory(peract.DRAWER_M), matrices={})
    (parcel,) = read(tmp_path)
    assert parcel.metadata["cameras"] == []
    assert parcel.notes == ("no camera calibration in misc: images are left out",)


class Hostile:
    def __reduce__(self):
        return (print, ("this must not be called",))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (pickle.dumps(Hostile()), "names builtins.print"),
        (b"c_codecs\nencode\n(VAAAA\nVzlib_codec\ntR.", "encoding 'zlib_codec' is not allowed"),
        (pickle.dumps([1, 2]), "is not a recorded RLBench demonstration"),
        (b"\x80\x04", "cannot be read"),
        (b"", "cannot be read"),
        (pickle.dumps([]), "has no observations"),
    ],
)
def test_a_pickle_that_is_no_demonstration(folder, tmp_path, capsys, content, reason):
    (folder / "low_dim_obs.pkl").write_bytes(content)
    with pytest.raises(DamagedError, match=reason) as caught:
        read(tmp_path)
    assert "low_dim_obs.pkl" in str(caught.value)
    assert capsys.readouterr().out == ""


def test_damaged_files_are_named(folder, tmp_path):
    (folder / "front_depth/0.png").write_bytes((folder / "front_depth/0.png").read_bytes()[:100])
    with pytest.raises(DamagedError, match=r"front_depth/0\.png: is damaged"):
        read(tmp_path)
    (folder / "variation_descriptions.pkl").unlink()
    with pytest.raises(DamagedError, match="--instruction"):
        read(tmp_path)
    (folder / "low_dim_obs.pkl").unlink()
    with pytest.raises(DamagedError, match=r"low_dim_obs\.pkl: cannot be read"):
        read(tmp_path)


def test_nothing_of_a_known_format(tmp_path):
    with pytest.raises(DatasetError, match="of no known format"):
        open_dataset(tmp_path, DRAWER)
    with pytest.raises(DatasetError, match="does not exist"):
        open_dataset(tmp_path / "elsewhere", DRAWER)
