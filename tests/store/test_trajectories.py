import numpy as np
import pytest

from app.store import trajectories
from app.store.errors import CorruptDataError
from roboprompt_client.types.trajectory import Trajectory

from .drafts import trajectory


def assert_same_bits(one, other):
    assert vars(one).keys() == vars(other).keys()
    for name, array in vars(one).items():
        restored = getattr(other, name)
        if array is None:
            assert restored is None
            continue
        assert (restored.dtype, restored.shape, restored.flags.writeable) == (array.dtype, array.shape, False), name
        assert restored.tobytes() == array.tobytes(), name


@pytest.mark.parametrize("optional_arrays", [True, False])
@pytest.mark.parametrize("num_frames", [1, 2, 500])
def test_every_bit_comes_back(num_frames, optional_arrays):
    recorded = trajectory(num_frames, seed=num_frames, optional_arrays=optional_arrays)
    assert_same_bits(recorded, trajectories.unpack(trajectories.pack(recorded), "e1"))


@pytest.mark.parametrize("num_joints", [0, 1, 5, 6, 16])
def test_an_arm_of_other_than_seven_joints(num_joints):
    usual = vars(trajectory())
    joints = np.random.default_rng(num_joints).normal(size=(len(usual["positions_m"]), num_joints))
    widths = np.linspace(0, 0.08, len(joints))
    recorded = Trajectory(
        **{
            **usual,
            "joint_velocities_rad_s": joints,
            "joint_positions_rad": joints,
            "gripper_width_m": widths,
            "wrenches_n_nm": np.outer(widths, np.arange(6)),
        }
    )
    assert_same_bits(recorded, trajectories.unpack(trajectories.pack(recorded), "e1"))


def test_any_changed_byte_is_noticed():
    blob = trajectories.pack(trajectory())
    for position in [*range(40), *range(40, len(blob), 97), len(blob) - 1]:
        damaged = bytearray(blob)
        damaged[position] ^= 0x40
        with pytest.raises(CorruptDataError, match="trajectory e1 is damaged"):
            trajectories.unpack(bytes(damaged), "e1")


@pytest.mark.parametrize("length", [0, 5, 9, 100])
def test_cut_blob_is_noticed(length):
    with pytest.raises(CorruptDataError, match="e1"):
        trajectories.unpack(trajectories.pack(trajectory())[:length], "e1")
