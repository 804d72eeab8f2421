import sys

import numpy as np
import pytest
from mcap.writer import CompressionType
from mcap_ros2.writer import Writer

from app.datasets.apart import open_dataset
from app.datasets.bounds import DamagedError, MissingPackageError
from app.datasets.options import ImportOptions, KnownObjects
from app.datasets.parcel import ObjectEntry
from app.pipeline.keyframes import Motion, merged
from app.untrusted_arrays import trajectory_from_npz
from tests.datasets.parcels import PLACES_M
from tests.episodes import pick_trajectory

RATE_HZ = 20
START_NS = 1_700_000_000_000_000_000
HEADER = """std_msgs/Header header
{fields}
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
JOINT_STATE = HEADER.format(fields="string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort")
POSE_STAMPED = (
    HEADER.format(fields="geometry_msgs/Pose pose")
    + """================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""
)
STAMP = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "world"}
FINGERS = ["panda_finger_joint1", "panda_finger_joint2"]
SAID = ImportOptions(instruction="pick it up", objects=KnownObjects((ObjectEntry("cube", PLACES_M[0]),)))


def pose(position_m, quaternion_xyzw):
    xyz = dict(zip("xyz", map(float, position_m), strict=True))
    return {
        "header": STAMP,
        "pose": {"position": xyz, "orientation": dict(zip("xyzw", map(float, quaternion_xyzw), strict=True))},
    }


def write(path, trajectory, tracked=False, compression=CompressionType.ZSTD):
    """A recording with joints in an order of its own, poses a little before them, and the gripper's command."""
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        joints = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        poses = writer.register_msgdef("geometry_msgs/msg/PoseStamped", POSE_STAMPED)
        command = writer.register_msgdef("std_msgs/msg/Bool", "bool data")
        text = writer.register_msgdef("std_msgs/msg/String", "string data")
        writer.write_message("/notes", text, {"data": "hello"}, START_NS)
        order = [f"panda_joint{k}" for k in range(7, 0, -1)]
        for t in range(len(trajectory)):
            time_ns = START_NS + t * 1_000_000_000 // RATE_HZ
            at = pose(trajectory.positions_m[t], trajectory.quaternions_xyzw[t])
            writer.write_message("/ee_pose", poses, at, time_ns - 1000)
            writer.write_message("/gripper/open", command, {"data": bool(trajectory.gripper_open[t])}, time_ns - 900)
            if tracked:
                writer.write_message("/cube", poses, pose(PLACES_M[0], (0, 0, 0, 1)), time_ns - 800)
            velocities = [*trajectory.joint_velocities_rad_s[t, ::-1].tolist(), 9.0, 9.0]
            state = {"name": order + FINGERS, "position": [0.0] * 9, "velocity": velocities, "effort": []}
            writer.write_message("/joint_states", joints, {"header": STAMP, **state}, time_ns)
        writer.finish()


def test_topics_are_recognized_by_their_types(tmp_path):
    write(tmp_path / "run 1.mcap", pick_trajectory(PLACES_M[0]))
    write(tmp_path / "run 2.mcap", pick_trajectory(PLACES_M[1]))
    dataset = open_dataset(tmp_path, SAID)
    assert [entry.name for entry in dataset.entries] == ["run 1", "run 2"]
    for entry, place_m in zip(dataset.entries, PLACES_M[:2], strict=True):
        parcel, expected = entry.read(), pick_trajectory(place_m)
        trajectory = trajectory_from_npz(parcel.files["trajectory"])
        np.testing.assert_array_equal(trajectory.joint_velocities_rad_s, expected.joint_velocities_rad_s)
        np.testing.assert_array_equal(trajectory.positions_m, expected.positions_m)
        np.testing.assert_array_equal(trajectory.gripper_open, expected.gripper_open)
        assert merged(Motion.of(trajectory)) == merged(Motion.of(expected))
        assert parcel.metadata["control_frequency_hz"] == pytest.approx(RATE_HZ)


def test_a_tracked_object_by_mapping(tmp_path):
    write(tmp_path / "run.mcap", pick_trajectory(PLACES_M[0]), tracked=True)
    features = {
        "end_effector_positions": "/ee_pose.position",
        "end_effector_rotations": "/ee_pose.quaternion",
        "objects": [{"name": "cube", "position": "/cube.position", "rotation": "/cube.quaternion"}],
    }
    parcel = open_dataset(tmp_path / "run.mcap", ImportOptions(instruction="pick", features=features)).entries[0].read()
    assert parcel.metadata["objects"][0]["position"] == list(PLACES_M[0])
    with pytest.raises(ValueError, match=r"end_effector_rotations.*/cube\.quaternion"):
        open_dataset(tmp_path / "run.mcap", SAID).entries[0].read()


def test_a_file_that_is_cut_off_is_named(tmp_path):
    path = tmp_path / "run.mcap"
    write(path, pick_trajectory(PLACES_M[0]))
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(DamagedError, match=r"run\.mcap"):
        open_dataset(path, SAID).entries[0].read()


@pytest.mark.parametrize("compression", CompressionType)
def test_every_compression(tmp_path, compression):
    write(tmp_path / "run.mcap", pick_trajectory(PLACES_M[0]), compression=compression)
    parcel = open_dataset(tmp_path, SAID).entries[0].read()
    assert len(trajectory_from_npz(parcel.files["trajectory"])) == len(pick_trajectory(PLACES_M[0]))


def test_a_changed_chunk_is_named(tmp_path):
    path = tmp_path / "run.mcap"
    write(path, pick_trajectory(PLACES_M[0]), compression=CompressionType.NONE)
    path.write_bytes(path.read_bytes().replace(b"hello", b"jello"))
    with pytest.raises(DamagedError, match=r"run\.mcap: cannot be read: a chunk does not match its checksum"):
        open_dataset(path, SAID).entries[0].read()


def test_the_package_that_is_missing(tmp_path, monkeypatch):
    write(tmp_path / "run.mcap", pick_trajectory(PLACES_M[0]))
    monkeypatch.setitem(sys.modules, "mcap_ros2.decoder", None)
    with pytest.raises(MissingPackageError, match="mcap-ros2-support"):
        open_dataset(tmp_path, SAID).entries[0].read()
