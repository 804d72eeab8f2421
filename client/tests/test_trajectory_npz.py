import io

import numpy as np
import pytest

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.trajectory import npz_from_trajectory, trajectory_from_arrays, trajectory_from_file

FRAMES = 21
TIMES_S = np.arange(FRAMES) / 20
WIDTHS_M = np.concatenate([np.full(10, 0.079), np.full(11, 0.031)])  # closed on a thing of 3 cm
ARRAYS = {
    "end_effector_positions": np.linspace([0.1, 0, 0.5], [0.3, 0.1, 0.2], FRAMES),
    "end_effector_quaternions_xyzw": np.tile([0.0, 0.6, 0.0, 0.8], (FRAMES, 1)),
    "gripper_open": np.arange(FRAMES) < 10,
}
OPTIONAL = {
    "joint_velocities": np.random.default_rng(0).normal(size=(FRAMES, 7)),
    "timestamps": TIMES_S,
    "joint_positions": np.ones((FRAMES, 7)),
    "object_positions": np.random.default_rng(2).normal(size=(FRAMES, 2, 3)),
    "object_quaternions_xyzw": np.tile([0.0, 0.6, 0.0, 0.8], (FRAMES, 2, 1)),
    "gripper_width": WIDTHS_M,
}


def arrays(**changes):
    return {name: array for name, array in {**ARRAYS, **changes}.items() if array is not None}


def test_a_file_comes_back_bit_by_bit_and_what_is_none_is_refused(tmp_path):
    recorded, file = trajectory_from_arrays({**ARRAYS, **OPTIONAL}), tmp_path / "pick.npz"
    file.write_bytes(npz_from_trajectory(recorded))
    for name, array in vars(trajectory_from_file(file)).items():
        np.testing.assert_array_equal(array, getattr(recorded, name))
    pickled, array, cut = tmp_path / "pickled.npz", tmp_path / "array.npy", tmp_path / "cut.npz"
    np.savez(pickled, gripper_open=np.array([{}], object))
    np.save(array, np.ones(3))
    cut.write_bytes(file.read_bytes()[:-30])
    for path in (pickled, array, cut, tmp_path / "none.npz"):
        with pytest.raises(InvalidInputError, match=f"{path.name} is not a readable"):
            trajectory_from_file(path)


@pytest.mark.parametrize("name", [*ARRAYS, *OPTIONAL])
@pytest.mark.parametrize(
    "spoilt", [[], {}, [[]], "text", 10**400, [10**400], [1, [2]], [[1], [2, 3]], [None], ["1"], [[[[1.0]]]]]
)
def test_what_is_no_list_of_numbers_is_refused_by_name(name, spoilt):
    lists = {key: array.tolist() for key, array in (ARRAYS | OPTIONAL).items()}
    for whole in (spoilt, [spoilt, *lists[name][1:]]):
        with pytest.raises(InvalidInputError, match=r"^trajectory\."):
            trajectory_from_arrays({**lists, name: whole})


@pytest.mark.parametrize("num_joints", [1, 5, 6, 16])
def test_velocities_follow_from_positions_and_times(num_joints):
    speeds = np.linspace(0.1, 0.5, num_joints)
    recorded = trajectory_from_arrays(arrays(joint_positions=np.outer(TIMES_S, speeds), timestamps=TIMES_S))
    assert recorded.num_joints == num_joints
    np.testing.assert_allclose(recorded.joint_velocities_rad_s, np.tile(speeds, (FRAMES, 1)))


def test_without_joints_there_are_none():
    recorded = trajectory_from_arrays(arrays())
    assert (recorded.num_joints, len(recorded)) == (0, FRAMES)
    assert "joint_velocities" not in np.load(io.BytesIO(npz_from_trajectory(recorded)))


def test_positions_without_times_say_what_is_missing():
    with pytest.raises(InvalidInputError, match="no timestamps") as caught:
        trajectory_from_arrays(arrays(joint_positions=np.zeros((FRAMES, 6))))
    assert caught.value.field == "trajectory.joint_velocities"
    with pytest.raises(InvalidInputError, match="is not after the one before"):
        trajectory_from_arrays(arrays(joint_positions=np.zeros((FRAMES, 6)), timestamps=np.zeros(FRAMES)))


def test_seventeen_joints_are_no_arm():
    with pytest.raises(InvalidInputError, match="has 17 joints"):
        trajectory_from_arrays(arrays(joint_velocities=np.zeros((FRAMES, 17))))


def test_measured_fingers_are_open_above_the_middle_or_above_what_is_said():
    recorded = trajectory_from_arrays(arrays(gripper_open=None, gripper_width=WIDTHS_M))
    np.testing.assert_array_equal(recorded.gripper_open, np.arange(FRAMES) < 10)
    assert recorded.with_gripper_open_above(0.02).gripper_open.all()
    assert not recorded.with_gripper_open_above(0.08).gripper_open.any()
    assert recorded.with_gripper_open_above(None) is recorded
    written = np.load(io.BytesIO(npz_from_trajectory(recorded)))
    np.testing.assert_array_equal(written["gripper_width"], WIDTHS_M)


def test_fingers_that_do_not_move_do_not_say_whether_they_are_open():
    still = arrays(gripper_open=None, gripper_width=np.full(FRAMES, 0.04))
    with pytest.raises(InvalidInputError, match=r"stays at 0\.0400") as caught:
        trajectory_from_arrays(still)
    assert "gripper_open" in caught.value.valid
    assert trajectory_from_arrays({**still, "gripper_open": np.ones(FRAMES)}).gripper_open.all()


@pytest.mark.parametrize(
    "widths", [np.full(FRAMES, 80.0), np.full(FRAMES - 1, 0.04), np.full((FRAMES, 2), 0.04), ["wide"] * FRAMES]
)
def test_widths_are_meters(widths):
    with pytest.raises(InvalidInputError) as caught:
        trajectory_from_arrays(arrays(gripper_width=widths))
    assert caught.value.field == "trajectory.gripper_width"
