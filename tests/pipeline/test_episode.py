import math

import numpy as np
import pytest

from app.pipeline.episode import Episode, frame_times_s
from roboprompt_client.errors import InvalidInputError, RoboPromptError
from roboprompt_client.types.arrays import finite_array, unit_quaternions
from roboprompt_client.types.names import checked_object_name
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose
from roboprompt_client.types.trajectory import Trajectory

T = 5


def with_element(array, value):
    changed = np.array(array, dtype=float)
    changed.flat[-1] = value
    return changed


VALID = {
    "joint_velocities_rad_s": np.ones((T, 7)),
    "positions_m": np.ones((T, 3)),
    "quaternions_xyzw": np.tile([0.0, 0.6, 0.0, 0.8], (T, 1)),
    "gripper_open": np.array([1, 1, 0, 0, 1]),
    "timestamps_s": np.arange(T) / 20,
    "joint_positions_rad": np.ones((T, 7)),
    "object_positions_m": np.ones((T, 2, 3)),
    "object_quaternions_xyzw": np.tile([0.0, 0.6, 0.0, 0.8], (T, 2, 1)),
    "gripper_width_m": np.linspace(0, 0.08, T),
}
VELOCITIES, POSITIONS, QUATERNIONS = (
    "trajectory.joint_velocities",
    "trajectory.end_effector_positions",
    "trajectory.end_effector_quaternions_xyzw",
)


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"joint_velocities_rad_s": np.ones((0, 7))}, VELOCITIES),
        ({"joint_velocities_rad_s": np.ones((T, 17))}, VELOCITIES),
        ({"joint_velocities_rad_s": np.ones((T, 6))}, "trajectory.joint_positions"),
        ({"joint_velocities_rad_s": np.ones(7)}, VELOCITIES),
        ({"joint_velocities_rad_s": with_element(np.ones((T, 7)), math.nan)}, VELOCITIES),
        ({"joint_velocities_rad_s": [[0.0] * 7, [0.0] * 6]}, VELOCITIES),
        ({"positions_m": np.ones((T + 1, 3))}, POSITIONS),
        ({"positions_m": with_element(np.ones((T, 3)), -math.inf)}, POSITIONS),
        ({"quaternions_xyzw": np.ones((T, 4))}, QUATERNIONS),
        ({"quaternions_xyzw": np.full((T, 4), 1e200)}, QUATERNIONS),
        ({"quaternions_xyzw": VALID["quaternions_xyzw"][:, :3]}, QUATERNIONS),
        ({"gripper_open": [1, 1, 0.5, 0, 0]}, "trajectory.gripper_open"),
        ({"gripper_open": ["1"] * T}, "trajectory.gripper_open"),
        ({"timestamps_s": [0, 0.1, 0.1, 0.2, 0.3]}, "trajectory.timestamps"),
        ({"timestamps_s": np.arange(T + 1)}, "trajectory.timestamps"),
        ({"joint_positions_rad": np.ones((T, 6))}, "trajectory.joint_positions"),
        ({"object_positions_m": np.ones((T, 3))}, "trajectory.object_positions"),
        ({"object_positions_m": None}, "trajectory.object_quaternions_xyzw"),
        ({"object_quaternions_xyzw": np.ones((T, 2, 4))}, "trajectory.object_quaternions_xyzw"),
        ({"gripper_width_m": np.full(T, 80.0)}, "trajectory.gripper_width"),
        ({"gripper_width_m": np.full(T, -0.01)}, "trajectory.gripper_width"),
    ],
)
def test_a_trajectory_that_does_not_fit_is_refused(changes, field):
    with pytest.raises(InvalidInputError) as caught:
        Trajectory(**{**VALID, **changes})
    assert caught.value.field == field


def test_a_valid_trajectory_is_kept_and_read_only():
    recorded = Trajectory(**VALID, wrenches_n_nm=np.zeros((T, 6)))
    assert len(recorded) == T
    assert recorded.gripper_open.dtype == np.bool_
    np.testing.assert_array_equal(recorded.quaternions_xyzw, VALID["quaternions_xyzw"])
    for array in vars(recorded).values():
        assert not array.flags.writeable
    optional = ("timestamps_s", "joint_positions_rad", "object_quaternions_xyzw", "object_positions_m")
    bare = Trajectory(**{**VALID, **dict.fromkeys(optional)})
    assert [getattr(bare, name) for name in optional] == [None] * 4


def test_tracked_objects_are_poses_at_any_frame():
    lid, jar = Trajectory(**VALID).objects_at(3, ["lid", "jar"])
    assert (lid.name, jar.name) == ("lid", "jar")
    np.testing.assert_array_equal(jar.quaternion_xyzw, [0.0, 0.6, 0.0, 0.8])
    positions_only = Trajectory(**{**VALID, "object_quaternions_xyzw": None})
    assert positions_only.objects_at(3, ["lid", "jar"])[0].quaternion_xyzw is None
    untracked = Trajectory(**{**VALID, "object_positions_m": None, "object_quaternions_xyzw": None})
    assert (untracked.objects_at(3, ["lid"]), untracked.num_objects) == ((), 0)


def test_the_callers_arrays_stay_their_own():
    velocities = np.ones((T, 7))
    recorded = Trajectory(**{**VALID, "joint_velocities_rad_s": velocities})
    velocities[:] = 9
    assert recorded.joint_velocities_rad_s.max() == 1


@pytest.mark.parametrize(
    "value",
    [[1j], np.array([1 + 2j]), ["1"], [None], [10**400], [[1], [2, 3]], np.array(["2020-01-01"], "datetime64[s]"), "x"],
    ids=repr,
)
def test_what_is_not_numbers_is_refused(value):
    with pytest.raises(InvalidInputError, match="is not an array of numbers"):
        finite_array("field", value, (1,))


def test_errors_name_field_element_and_remedy():
    with pytest.raises(InvalidInputError) as caught:
        finite_array("cup.position", [[1, 2], [3, math.nan]], (None, 2))
    assert str(caught.value) == "cup.position: element [1, 1] is nan (valid: finite numbers)"
    with pytest.raises(InvalidInputError, match=r"a: has shape \(2,\) \(valid: shape \(T, 3\)\)"):
        finite_array("a", [1, 2], (None, 3))
    assert issubclass(InvalidInputError, RoboPromptError)


def test_a_slightly_long_quaternion_is_normalized_once():
    unit = unit_quaternions("q", [0, 0, 0, 1.0009], (4,))
    np.testing.assert_array_equal(unit, [0, 0, 0, 1])
    generated = np.random.default_rng(0).normal(size=(200, 4))
    once = unit_quaternions("q", generated / np.linalg.norm(generated, axis=1, keepdims=True), (None, 4))
    np.testing.assert_array_equal(unit_quaternions("q", once, (None, 4)), once)


@pytest.mark.parametrize(
    "name",
    [
        "",
        " a",
        "a ",
        "a\n",
        "a\nb",
        "it's",
        'a"b',
        "a;b",
        "a:b",
        "}>[[",
        "a{",
        "a\u0301\u200b",
        "\u0301a",
        "\uff1ca",
        "-a",
        "a.",
        "x" * 65,
    ],
)
def test_bad_names(name):
    with pytest.raises(InvalidInputError) as caught:
        checked_object_name("objects.name", name)
    assert caught.value.field == "objects.name"


@pytest.mark.parametrize("text", ["", "x" * 501, "push }>[["])
def test_bad_instructions(text):
    with pytest.raises(InvalidInputError) as caught:
        Episode(text, Trajectory(**VALID))
    assert caught.value.field == "instruction"


@pytest.mark.parametrize("frequency_hz", [0.0, -1.0, math.nan, math.inf])
def test_bad_control_frequencies(frequency_hz):
    with pytest.raises(InvalidInputError) as caught:
        Episode("push", Trajectory(**VALID), control_frequency_hz=frequency_hz)
    assert caught.value.field == "control_frequency_hz"


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: ObjectPose("cup", np.ones(2)), "objects[cup].position"),
        (lambda: ObjectPose("cup", np.array([0, math.nan, 0])), "objects[cup].position"),
        (lambda: ObjectPose("cup", np.ones(3), np.ones(4)), "objects[cup].quaternion_xyzw"),
        (lambda: ObjectPose("a;b", np.ones(3)), "objects.name"),
        (lambda: EndEffectorAction(np.ones(4), np.array([0, 0, 0, 1]), True), "action.position"),
        (lambda: EndEffectorAction(np.ones(3), np.ones(4), True), "action.quaternion_xyzw"),
    ],
)
def test_poses_and_actions_are_checked(make, field):
    with pytest.raises(InvalidInputError) as caught:
        make()
    assert caught.value.field == field


@pytest.mark.parametrize(("timestamps_s", "frequency_hz"), [(np.arange(T) / 50, 50.0), (None, 20.0)])
def test_the_rate_is_that_of_the_timestamps(timestamps_s, frequency_hz):
    recorded = Trajectory(**{**VALID, "timestamps_s": timestamps_s})
    assert Episode("press", recorded).control_frequency_hz == frequency_hz


def test_times_come_from_timestamps_or_from_the_frequency():
    without = Trajectory(**{**VALID, "timestamps_s": None})
    np.testing.assert_allclose(frame_times_s(without, 20.0)[:3], [0, 0.05, 0.1])
    times_s = np.array([5.0, 5.1, 5.3, 5.4, 5.5])
    np.testing.assert_allclose(frame_times_s(Trajectory(**{**VALID, "timestamps_s": times_s}), 20.0)[:3], [0, 0.1, 0.3])
