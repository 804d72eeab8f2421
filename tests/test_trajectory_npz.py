"""Trajectories in `.npz` files from untrusted senders."""

import io
import zipfile

import numpy as np
import pytest

from app.untrusted_arrays import MAX_UNPACKED_BYTES, trajectory_from_npz
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.trajectory import Trajectory, npz_from_trajectory, trajectory_from_arrays
from tests.npy_files import npy

T = 6
ARRAYS = {
    "joint_velocities": np.random.default_rng(0).normal(size=(T, 7)),
    "end_effector_positions": np.random.default_rng(1).normal(size=(T, 3)),
    "end_effector_quaternions_xyzw": np.tile([0.0, 0.6, 0.0, 0.8], (T, 1)),
    "gripper_open": np.array([1, 1, 1, 0, 0, 0]),
}
OPTIONAL = {
    "timestamps": np.arange(T) / 20,
    "joint_positions": np.ones((T, 7)),
    "object_positions": np.random.default_rng(2).normal(size=(T, 2, 3)),
    "object_quaternions_xyzw": np.tile([0.0, 0.6, 0.0, 0.8], (T, 2, 1)),
    "gripper_width": np.linspace(0.08, 0.0, T),
}


def zipped(members):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return stream.getvalue()


def npz(**changes):
    arrays = {**ARRAYS, **changes}
    return zipped({f"{name}.npy": npy(array) for name, array in arrays.items() if array is not None})


@pytest.mark.parametrize("optional", [{}, OPTIONAL])
def test_a_trajectory_comes_back_bit_by_bit(optional):
    recorded = trajectory_from_arrays({**ARRAYS, **optional})
    back = trajectory_from_npz(npz_from_trajectory(recorded))
    for name, array in vars(recorded).items():
        np.testing.assert_array_equal(getattr(back, name), array)
    assert (back.timestamps_s is None) == (not optional)


def test_files_of_numpy_are_read():
    stream = io.BytesIO()
    np.savez(stream, **ARRAYS)
    assert isinstance(trajectory_from_npz(stream.getvalue()), Trajectory)
    np.testing.assert_array_equal(trajectory_from_npz(npz()).positions_m, ARRAYS["end_effector_positions"])


def changed(data, change):
    """The same file with other bytes at some places."""
    copy = bytearray(data)
    for place, byte in change.items():
        copy[place] = byte
    return bytes(copy)


GOOD = npz()
LISTED = GOOD.index(b"PK\x01\x02")  # the first member's entry in the zip file's directory
CONTENT = 30 + len("joint_velocities.npy")  # where its content begins
DAMAGED = {
    "checksum": changed(GOOD, {LISTED + 16: GOOD[LISTED + 16] ^ 0xFF}),
    "deflate": changed(GOOD, {CONTENT: 0xFF}),
    "encrypted": changed(GOOD, {6: 1, LISTED + 8: 1}),
    "unknown compression": changed(GOOD, {8: 99, LISTED + 10: 99}),
    "cut off": GOOD[:-30],
    "empty": b"",
    "junk": b"junk",
    "no zip": npy(np.ones(3)),
}


@pytest.mark.parametrize("data", DAMAGED.values(), ids=DAMAGED)
def test_a_damaged_file_is_refused(data):
    assert isinstance(trajectory_from_npz(GOOD), Trajectory)
    with pytest.raises(InvalidInputError, match=r"is empty|is not a readable \.npz file") as caught:
        trajectory_from_npz(data)
    assert caught.value.field == "trajectory"


@pytest.mark.parametrize(
    ("data", "field"),
    [
        (zipped({}), "trajectory.end_effector_positions"),
        (npz(gripper_open=None), "trajectory.gripper_open"),
        (npz(gripper_opened=np.ones(T)), "trajectory.gripper_opened"),
        (npz(gripper_open=np.ones(T + 1)), "trajectory.gripper_open"),
        (npz(gripper_open=np.ones(100_001)), "trajectory"),
        (npz(gripper_open=np.array(["1"] * T)), "trajectory.gripper_open"),
        (zipped({"notes.txt": b"hello"}), "trajectory.notes.txt"),
        (npz(gripper_open=np.array([{}], object)), "trajectory.gripper_open"),  # a pickle: what else, see test_npy
    ],
)
def test_what_is_no_trajectory_is_refused_by_name(data, field):
    with pytest.raises(InvalidInputError) as caught:
        trajectory_from_npz(data)
    assert caught.value.field == field


def test_a_zip_bomb_is_refused_before_it_is_unpacked():
    bomb = zipped({"gripper_open.npy": b"\0" * (MAX_UNPACKED_BYTES + 1)})
    assert len(bomb) < 1_000_000
    with pytest.raises(InvalidInputError, match="unpacks to 100000001 bytes"):
        trajectory_from_npz(bomb)
