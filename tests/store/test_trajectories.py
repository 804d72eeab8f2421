import numpy as np
import pytest

from app.store import trajectories
from app.store.errors import CorruptDataError
from roboprompt_client.types.trajectory import Trajectory, npz_from_trajectory

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
    assert_same_bits(recorded, trajectories.unpack(npz_from_trajectory(recorded), "e1"))


@pytest.mark.parametrize("num_joints", [0, 1, 16])
def test_an_arm_of_other_than_seven_joints(num_joints):
    usual = trajectory(40, optional_arrays=False)
    joints = np.random.default_rng(num_joints).normal(size=(40, num_joints))
    recorded = Trajectory(**{**vars(usual), "joint_velocities_rad_s": joints})
    assert_same_bits(recorded, trajectories.unpack(npz_from_trajectory(recorded), "e1"))


def test_a_changed_byte_is_noticed_or_changes_no_number():
    recorded = trajectory()
    npz, noticed = npz_from_trajectory(recorded), 0
    positions = [*range(40), *range(40, len(npz), 97), len(npz) - 1]
    for position in positions:
        damaged = bytearray(npz)
        damaged[position] ^= 0x40
        try:
            restored = trajectories.unpack(bytes(damaged), "e1")
        except CorruptDataError:
            noticed += 1
        else:
            assert_same_bits(recorded, restored)
    assert noticed > len(positions) / 2


@pytest.mark.parametrize("length", [0, 5, 100, 3000])
def test_a_cut_file_is_noticed(length):
    with pytest.raises(CorruptDataError, match="e1"):
        trajectories.unpack(npz_from_trajectory(trajectory())[:length], "e1")
