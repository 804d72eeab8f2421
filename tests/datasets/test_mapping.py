import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.datasets.bounds import DatasetError
from app.datasets.columns import FeatureMap, objects_of, quaternions_xyzw, selected, trajectory_of
from app.datasets.options import read_mapping
from roboprompt_client.errors import InvalidInputError

NUM_FRAMES, FREQUENCY_HZ = 12, 10.0
TIMES_S = np.arange(NUM_FRAMES) / FREQUENCY_HZ


def columns():
    angles = np.linspace(0, 1, NUM_FRAMES)
    return {
        "q": np.outer(np.sin(TIMES_S), np.arange(1, 8)),
        "state": np.column_stack([np.arange(NUM_FRAMES * 3).reshape(-1, 3), np.zeros((NUM_FRAMES, 2)), angles]),
        "action": np.column_stack([np.zeros(NUM_FRAMES), np.where(angles < 0.5, -1.0, 1.0)]),
        "cube": np.tile([0.1, 0.2, 0.3], (NUM_FRAMES, 1)),
    }


def mapping(**changes):
    document = {
        "joint_positions": "q",
        "end_effector_positions": "state[0:3]",
        "end_effector_rotations": "state[3:6]",
        "rotation_format": "euler_xyz",
        "gripper": "action[-1]",
        "gripper_open_below": 0,
    }
    return FeatureMap().changed({**document, **changes})


def test_a_trajectory_from_columns_of_other_names():
    trajectory = trajectory_of(columns(), mapping(), FREQUENCY_HZ)
    np.testing.assert_array_equal(trajectory.positions_m, columns()["state"][:, :3])
    np.testing.assert_array_equal(trajectory.gripper_open, np.linspace(0, 1, NUM_FRAMES) < 0.5)
    yaw_rad = Rotation.from_quat(trajectory.quaternions_xyzw).as_euler("xyz")[:, 2]
    np.testing.assert_allclose(yaw_rad, np.linspace(0, 1, NUM_FRAMES), atol=1e-12)


def test_velocities_are_derived_where_there_are_none():
    trajectory = trajectory_of(columns(), mapping(), FREQUENCY_HZ)
    expected = np.outer(np.cos(TIMES_S), np.arange(1, 8))
    np.testing.assert_allclose(trajectory.joint_velocities_rad_s[1:-1], expected[1:-1], atol=0.02)


def test_uneven_times_count():
    times_s = TIMES_S**1.5
    uneven = {**columns(), "t": times_s, "q": np.outer(times_s, np.ones(7))}
    trajectory = trajectory_of(uneven, mapping(timestamps="t"), FREQUENCY_HZ)
    np.testing.assert_allclose(trajectory.joint_velocities_rad_s, 1.0)


def test_tracked_objects():
    chosen = mapping(objects=[{"name": "cube", "position": "cube"}])
    trajectory = trajectory_of(columns(), chosen, FREQUENCY_HZ)
    assert trajectory.object_positions_m.shape == (NUM_FRAMES, 1, 3)
    (cube,) = objects_of(trajectory, chosen)
    assert (cube.name, cube.position_m, cube.quaternion_xyzw) == ("cube", (0.1, 0.2, 0.3), None)


@pytest.mark.parametrize("form", ["quaternion_xyzw", "quaternion_wxyz", "euler_xyz", "rotation_vector"])
def test_rotation_formats(form):
    rotations = Rotation.random(5, rng=np.random.default_rng(0))
    given = {
        "quaternion_xyzw": rotations.as_quat(),
        "quaternion_wxyz": rotations.as_quat(scalar_first=True),
        "euler_xyz": rotations.as_euler("xyz"),
        "rotation_vector": rotations.as_rotvec(),
    }[form]
    turned = Rotation.from_quat(quaternions_xyzw(given, form)) * rotations.inv()
    np.testing.assert_allclose(turned.magnitude(), 0, atol=1e-12)


def test_selectors():
    table = {"a[0]": np.ones(2), "s": np.array([[1.0, 2, 3], [4, 5, 6]])}
    assert selected(table, "s[1]").tolist() == [2, 5]
    assert selected(table, "s[1:]").tolist() == [[2, 3], [5, 6]]
    assert selected(table, "s[-1]").tolist() == [3, 6]
    for wrong, message in (("s[3]", "cuts a column of shape"), ("t", "is no column"), ("s[x]", "is no column")):
        with pytest.raises(InvalidInputError, match=message):
            selected(table, wrong)


def test_what_is_missing_is_named_with_what_there_is():
    with pytest.raises(InvalidInputError, match=r"joint_velocities: .*q, state, action, cube"):
        trajectory_of(columns(), mapping(joint_positions=None), FREQUENCY_HZ)
    with pytest.raises(InvalidInputError, match="gripper_open_above"):
        trajectory_of(columns(), FeatureMap(**{**vars(mapping()), "gripper_open_below": None}), FREQUENCY_HZ)


@pytest.mark.parametrize("fingers", [np.linspace(0.08, 0.01, NUM_FRAMES), np.linspace(1.0, 0.6, NUM_FRAMES)])
def test_fingers_that_move_all_on_one_side_of_the_threshold_are_refused(fingers):
    """A width in meters, held against a threshold of 0.5: each grasp would be lost, and nothing would say so."""
    measured = mapping(gripper="width", gripper_open_above=0.5, gripper_open_below=None)
    with pytest.raises(InvalidInputError, match="neither opens nor closes"):
        trajectory_of({**columns(), "width": fingers}, measured, FREQUENCY_HZ)


@pytest.mark.parametrize(("at", "is_open"), [(0.0, False), (1.0, True)])
def test_fingers_that_stay_need_no_threshold_between(at, is_open):
    still = at + 0.001 * np.sin(TIMES_S)
    measured = mapping(gripper="width", gripper_open_above=0.5, gripper_open_below=None)
    assert (trajectory_of({**columns(), "width": still}, measured, FREQUENCY_HZ).gripper_open == is_open).all()


def test_a_mapping_from_a_file(tmp_path):
    path = tmp_path / "mapping.json"
    path.write_text(json.dumps({"gripper": "g", "gripper_open_above": 0.5}))
    changes = read_mapping(path)
    assert changes == {"gripper": "g", "gripper_open_above": 0.5}
    assert FeatureMap(gripper_open_below=0.0).changed(changes).gripper_open_below is None
    for wrong in ({"grip": "x"}, {"objects": [{"title": "x"}]}, {"cameras": [{"name": "front"}]}):
        with pytest.raises(DatasetError):
            FeatureMap().changed(wrong)
    with pytest.raises(DatasetError, match="elsewhere"):
        read_mapping(tmp_path / "elsewhere.json")
