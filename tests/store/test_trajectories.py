import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from app.store import trajectories
from app.store.errors import CorruptDataError
from roboprompt_client.arrays import MAX_M
from roboprompt_client.trajectory import MAX_RAD_S, Trajectory

from .drafts import trajectory


def finite(greatest: float) -> st.SearchStrategy[float]:
    return st.floats(-greatest, greatest)


def assert_same_bits(one: Trajectory, other: Trajectory) -> None:
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
def test_every_bit_comes_back(num_frames: int, optional_arrays: bool) -> None:
    recorded = trajectory(num_frames, seed=num_frames, optional_arrays=optional_arrays)
    assert_same_bits(recorded, trajectories.unpack(trajectories.pack(recorded), "e1"))


@settings(max_examples=50, derandomize=True, deadline=None)
@given(
    velocities=arrays(np.float64, (3, 7), elements=finite(MAX_RAD_S)),
    positions=arrays(np.float64, (3, 3), elements=finite(MAX_M)),
)
def test_any_finite_number_comes_back(velocities, positions) -> None:
    recorded = Trajectory(velocities, positions, np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)), np.array([True, False, True]))
    assert_same_bits(recorded, trajectories.unpack(trajectories.pack(recorded), "e1"))


@pytest.mark.parametrize("num_joints", [0, 1, 5, 6, 16])
def test_an_arm_of_other_than_seven_joints(num_joints: int) -> None:
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


def test_one_optional_array_without_the_other() -> None:
    full = trajectory()
    for missing in ("timestamps_s", "joint_positions_rad", "object_quaternions_xyzw"):
        recorded = Trajectory(**{**vars(full), missing: None})
        assert_same_bits(recorded, trajectories.unpack(trajectories.pack(recorded), "e1"))


def test_blob_of_a_smooth_motion_is_smaller_than_its_numbers() -> None:
    time_s = np.arange(200) / 20
    waves = np.sin(time_s[:, None] * np.arange(1, 8) / 3)
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (200, 1))
    recorded = Trajectory(waves, waves[:, :3], upright, time_s > 5, time_s, waves)
    assert len(trajectories.pack(recorded)) < 0.7 * 200 * (7 + 3 + 4 + 1 + 7) * 8


def test_any_changed_byte_is_noticed() -> None:
    blob = trajectories.pack(trajectory())
    for position in [*range(40), *range(40, len(blob), 97), len(blob) - 1]:
        damaged = bytearray(blob)
        damaged[position] ^= 0x40
        with pytest.raises(CorruptDataError, match="trajectory e1 is damaged"):
            trajectories.unpack(bytes(damaged), "e1")


@pytest.mark.parametrize("length", [0, 5, 9, 100])
def test_cut_blob_is_noticed(length: int) -> None:
    with pytest.raises(CorruptDataError, match="e1"):
        trajectories.unpack(trajectories.pack(trajectory())[:length], "e1")
