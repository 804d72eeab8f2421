import json
import sys

import h5py
import numpy as np
import pytest

from app.datasets.bounds import DamagedError, DatasetError
from app.datasets.formats import open_dataset
from app.datasets.options import ImportOptions
from app.perception.images import decode_rgb
from app.pipeline.keyframes import Motion, merged
from app.untrusted_arrays import trajectory_from_npz
from tests.datasets.parcels import PLACES_M
from tests.episodes import camera, pick_trajectory

SAID = ImportOptions(instruction="lift the cube")


@pytest.fixture
def path(tmp_path):
    """Two demonstrations with robosuite's names and conventions."""
    path = tmp_path / "low_dim.hdf5"
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        data.attrs["env_args"] = json.dumps({"env_name": "PickPlaceCan", "env_kwargs": {"control_freq": 10}})
        for number, place_m in ((10, PLACES_M[0]), (9, PLACES_M[1])):
            trajectory = pick_trajectory(place_m)
            frames = len(trajectory)
            demo = data.create_group(f"demo_{number}")
            demo["actions"] = np.column_stack([np.zeros((frames, 6)), np.where(trajectory.gripper_open, -1.0, 1.0)])
            observed = {
                "robot0_joint_vel": trajectory.joint_velocities_rad_s,
                "robot0_joint_pos": np.zeros((frames, 7)),
                "robot0_eef_pos": trajectory.positions_m,
                "robot0_eef_quat": trajectory.quaternions_xyzw,
                "robot0_gripper_qpos": np.zeros((frames, 2)),
                "Can_pos": np.tile(place_m, (frames, 1)),
                "Can_quat": np.tile([0.0, 0.0, 0.0, 1.0], (frames, 1)),
                "Can_to_robot0_eef_pos": np.zeros((frames, 3)),
                "agentview_image": np.full((frames, 48, 64, 3), 77, np.uint8),
            }
            for name, values in observed.items():
                demo[f"obs/{name}"] = values
    return path


def test_robosuites_names_need_no_mapping(path):
    dataset = open_dataset(path, SAID)
    assert [entry.name for entry in dataset.entries] == ["demo_9", "demo_10"]
    parcel = dataset.entries[0].read()
    assert parcel.metadata["task"] == "pick_place_can"
    assert parcel.metadata["control_frequency_hz"] == 10
    can = {"name": "Can", "position": list(PLACES_M[1]), "quaternion_xyzw": [0, 0, 0, 1]}
    assert parcel.metadata["objects"] == [can]
    assert parcel.notes == ("calibration of obs/agentview_image: images are left out",)
    trajectory = trajectory_from_npz(parcel.files["trajectory"])
    assert merged(Motion.of(trajectory)) == merged(Motion.of(pick_trajectory(PLACES_M[1])))
    np.testing.assert_array_equal(trajectory.gripper_open, pick_trajectory(PLACES_M[1]).gripper_open)


def test_a_camera_that_the_mapping_calibrates(path):
    front = {**camera(width=64, height=48), "rgb": "obs/agentview_image"}
    parcel = open_dataset(path, ImportOptions(instruction="lift", features={"cameras": [front]})).entries[0].read()
    assert (decode_rgb("rgb", parcel.files["rgb_front"]) == 77).all()


def test_what_is_missing_is_said(path, monkeypatch):
    with pytest.raises(ValueError, match="--instruction"):
        open_dataset(path, ImportOptions()).entries[0].read()
    with h5py.File(path, "a") as file:
        del file["data/demo_9/actions"]
    with pytest.raises(DamagedError, match="data/demo_9: cannot be read"):
        open_dataset(path, SAID).entries[0].read()
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(DatasetError, match="is no robomimic file"):
        open_dataset(path, SAID)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ModuleNotFoundError, match="h5py"):
        open_dataset(path, SAID)
