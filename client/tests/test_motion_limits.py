import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from roboprompt_client.errors import InvalidInputError, UnsafeActionError
from roboprompt_client.motion.guard import MotionGuard, action_from_json, angle_deg
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.types.poses import EndEffectorAction, Pose

WORKSPACE = Box((-0.3, -0.5, 0.6), (0.7, 0.5, 1.6))
DOWN = (1.0, 0.0, 0.0, 0.0)
GOOD = {"position": [0.1, 0.2, 0.9], "quaternion_xyzw": list(DOWN), "gripper_open": True}


def to(x_m=0.1, y_m=0.2, z_m=0.9, rotation=None):
    quaternion = np.array(DOWN) if rotation is None else rotation.as_quat()
    return EndEffectorAction(np.array([x_m, y_m, z_m]), quaternion, True)


def breach(limits, *actions, **options):
    """The error that the last of the actions meets; those before it pass."""
    guard = MotionGuard(limits, **options)
    for action in actions[:-1]:
        guard.check(action)
    with pytest.raises(UnsafeActionError) as caught:
        guard.check(actions[-1])
    return caught.value


@pytest.mark.parametrize(("axis", "value"), [("x", 0.71), ("y", -0.6), ("z", 0.59), ("z", 1e300)])
def test_a_target_outside_the_workspace_is_named(axis, value):
    error = breach(MotionLimits(WORKSPACE), to(), to(**{f"{axis}_m": value}))
    assert error.field == f"actions[1].position.{axis}"
    assert f"is {value:g} m" in str(error)
    assert "the workspace" in error.bound


def test_the_edges_belong_to_the_workspace():
    guard = MotionGuard(MotionLimits(WORKSPACE))
    guard.check(to(*WORKSPACE.min_m))
    guard.check(to(*WORKSPACE.max_m))
    guard.check(to(0.7 + 1e-12, 0.1 + 0.2 + 0.2, 0.6))


def test_keep_out_boxes():
    limits = MotionLimits(WORKSPACE, (Box((0, 0, 0.6), (0.2, 0.1, 1.0)), Box((0.0, 0.15, 0.6), (0.2, 0.3, 0.95))))
    error = breach(limits, to())
    assert error.field == "actions[0].position"
    assert "keep_out[1]" in error.bound
    MotionGuard(limits).check(to(z_m=1.0))  # the hand just touches its top
    assert "at least 0.05 m (hand_radius_m) outside keep_out[1]" in breach(limits, to(z_m=0.999)).bound
    MotionGuard(replace(limits, hand_radius_m=0)).check(to(z_m=0.95))


WALL = Box((0.3, -0.5, 0.6), (0.32, 0.5, 1.0))


@pytest.mark.parametrize("radius_m", [0, 0.05])
def test_the_way_between_targets_keeps_out(radius_m):
    limits = MotionLimits(WORKSPACE, (WALL,), hand_radius_m=radius_m)
    error = breach(limits, to(0.1), to(0.5))
    assert error.field == "actions[1].position"
    assert "reached straight from [0.1, 0.2, 0.9] m" in str(error)
    assert "keep_out[0]" in error.bound
    guard = MotionGuard(limits)
    for action in (to(0.1), to(0.1, z_m=1.1), to(0.5, z_m=1.1), to(0.5)):  # over it
        guard.check(action)
    assert "straight from" in breach(limits, to(0.5), before=Pose.of(to(0.1))).message


def test_a_way_without_measure_does_not_pass():
    far = Pose((1e300, 0.2, 0.9), DOWN)
    assert "keep_out[0]" in breach(MotionLimits(keep_out=(WALL,)), to(-1e300), before=far).bound


@given(*[st.tuples(st.floats(-0.3, 0.7), st.floats(-0.5, 0.5), st.floats(0.6, 1.6))] * 2, st.floats(0, 0.2))
def test_no_place_of_a_way_that_passes_is_too_near(start_m, end_m, radius_m):
    guard = MotionGuard(MotionLimits(WORKSPACE, (WALL,), hand_radius_m=radius_m), before=Pose(start_m, DOWN))
    places_m = np.linspace(start_m, end_m, 101)
    inside = ((places_m > np.add(WALL.min_m, 1e-8)) & (places_m < np.subtract(WALL.max_m, 1e-8))).all(axis=1).any()
    near_m = np.linalg.norm(places_m - np.clip(places_m, *WALL), axis=1).min()
    try:
        guard.check(to(*end_m))
    except UnsafeActionError:
        assert near_m <= radius_m + np.linalg.norm(np.subtract(end_m, start_m)) / 100
    else:
        assert not inside
        assert near_m >= radius_m - 1e-8


def test_steps_are_bounded_between_actions():
    limits = MotionLimits(max_step_m=0.1)
    error = breach(limits, to(), to(0.15), to(0.15, 0.31), before=Pose.of(to()))
    assert error.field == "actions[2].position"
    assert "is 0.11 m from the one before" in str(error)
    assert "unknown place" in breach(limits, to(0.69)).message
    assert breach(limits, to(0.69), before=Pose.of(to())).field == "actions[0].position"


def test_turns_are_bounded_between_actions():
    limits = MotionLimits(max_step_rotation_deg=45)
    turned = [to(rotation=Rotation.from_euler("z", angle, degrees=True)) for angle in (0, 45, 95)]
    error = breach(limits, *turned, before=Pose.of(turned[0]))
    assert error.field == "actions[2].quaternion_xyzw"
    assert "turned by 50 degrees" in str(error)
    opposite = EndEffectorAction(turned[0].position_m, -turned[0].quaternion_xyzw, True)  # the same rotation
    guard = MotionGuard(limits, before=Pose.of(turned[0]))
    guard.check(turned[0])
    guard.check(opposite)


def test_one_action_too_many():
    assert breach(MotionLimits(), to(), to(), to(), max_actions=2).field == "actions[2].index"


@given(
    st.lists(st.floats(-1, 1), min_size=8, max_size=8).filter(
        lambda v: np.linalg.norm(v[:4]) > 0.1 < np.linalg.norm(v[4:])
    )
)
def test_the_angle_is_that_of_the_relative_rotation(values):
    one, other = Rotation.from_quat(values[:4]), Rotation.from_quat(values[4:])
    expected = math.degrees((one.inv() * other).magnitude())
    assert angle_deg(tuple(one.as_quat()), tuple(other.as_quat())) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"position": [0.1, float("nan"), 1]}, "position"),
        ({"position": [0.1, float("inf"), 1]}, "position"),
        ({"position": [10**400, 0, 1]}, "position"),
        ({"position": [0.1, 1]}, "position"),
        ({"position": ["0.1", 0, 1]}, "position"),
        ({"position": None}, "position"),
        ({"quaternion_xyzw": [2, 0, 0, 0]}, "quaternion_xyzw"),
        ({"quaternion_xyzw": [0, 0, 0, 0]}, "quaternion_xyzw"),
        ({"quaternion_xyzw": [True, 0, 0, 0]}, "quaternion_xyzw"),
        ({"gripper_open": 1}, "gripper_open"),
        ({"gripper_open": "false"}, "gripper_open"),
        ({"gripper_open": None}, "gripper_open"),
    ],
)
def test_what_is_no_action_is_refused(change, field):
    with pytest.raises(UnsafeActionError) as caught:
        action_from_json(3, {**GOOD, **change})
    assert caught.value.field == f"actions[3].{field}"


@pytest.mark.parametrize("value", [None, [], "left", {}])
def test_what_is_no_document_is_refused(value):
    with pytest.raises(UnsafeActionError):
        action_from_json(0, value)


TASK = {
    "workspace": {"preset": "auto", "min": [0, 0, 0], "max": [1, 1, 1]},
    "motion_limits": {
        "keep_out": [{"min": [0, 0, 0], "max": [0.1, 0.1, 0.1]}],
        "max_step_m": 0.2,
        "max_step_rotation_deg": None,
        "hand_radius_m": 0.07,
    },
}


def changed(**bounds):
    """The task's document with other bounds; Ellipsis leaves one out."""
    limits = {**TASK["motion_limits"], **bounds}
    return {**TASK, "motion_limits": {name: value for name, value in limits.items() if value is not ...}}


def test_limits_as_a_task_tells_them():
    limits = MotionLimits.from_task(TASK)
    assert limits == MotionLimits(Box((0, 0, 0), (1, 1, 1)), (Box((0, 0, 0), (0.1, 0.1, 0.1)),), 0.2, None, 0.07)
    assert MotionLimits.from_task(changed(hand_radius_m=...)).hand_radius_m == 0.05


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("name", ["max_step_m", "max_step_rotation_deg", "hand_radius_m"])
@pytest.mark.parametrize("value", [NAN, INF, -INF, -0.1, "0.2", True, [0.2], {}, 10**400])
def test_a_bound_that_can_bound_nothing_is_refused(name, value):
    with pytest.raises(InvalidInputError) as caught:
        MotionLimits.from_task(changed(**{name: value}))
    assert caught.value.field == f"motion_limits.{name}"


@pytest.mark.parametrize(
    ("document", "field"),
    [
        (changed(max_step_m=0), "motion_limits.max_step_m"),
        (changed(max_step_m=...), "motion_limits.max_step_m"),
        (changed(max_step_rotation_deg=...), "motion_limits.max_step_rotation_deg"),
        (changed(max_step_rotation_deg=181), "motion_limits.max_step_rotation_deg"),
        (changed(hand_radius_m=None), "motion_limits.hand_radius_m"),
        (changed(keep_out=...), "motion_limits.keep_out"),
        (changed(keep_out=None), "motion_limits.keep_out"),
        (changed(keep_out={"min": [0, 0, 0]}), "motion_limits.keep_out"),
        (changed(keep_out=[{"min": [0, 0, 0]}]), "motion_limits.keep_out[0].max"),
        (changed(keep_out=["box"]), "motion_limits.keep_out[0]"),
        (changed(keep_out=[{"min": [0, 0, NAN], "max": [1, 1, 1]}]), "motion_limits.keep_out[0].min"),
        (changed(keep_out=[{"min": [0, 0, 0], "max": [1, INF, 1]}]), "motion_limits.keep_out[0].max"),
        (changed(keep_out=[{"min": [0, 0, 0], "max": [1, 0, 1]}]), "motion_limits.keep_out[0]"),
        (changed(keep_out=[{"min": [0, 0], "max": [1, 1, 1]}]), "motion_limits.keep_out[0].min"),
        ({**TASK, "workspace": {"min": [NAN] * 3, "max": [1, 1, 1]}}, "workspace.min"),
        ({**TASK, "workspace": {"min": "000", "max": [1, 1, 1]}}, "workspace.min"),
        ({**TASK, "workspace": None}, "workspace"),
        ({"motion_limits": TASK["motion_limits"]}, "workspace"),
        ({"workspace": TASK["workspace"]}, "motion_limits"),
        ({**TASK, "motion_limits": []}, "motion_limits"),
        ([], "limits"),
        (None, "limits"),
    ],
)
def test_a_document_without_limits_that_hold_is_refused(document, field):
    with pytest.raises(InvalidInputError) as caught:
        MotionLimits.from_task(document)
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("name", "value"), [("max_step_m", NAN), ("hand_radius_m", -1.0), ("workspace", Box((0, 0, 0), (1, 1, NAN)))]
)
def test_limits_made_in_code_must_hold_too(name, value):
    with pytest.raises(InvalidInputError, match=name):
        MotionLimits(**{name: value})


@pytest.mark.parametrize("pose", [Pose((NAN, 0, 0), DOWN), Pose((0, 0, INF), DOWN), Pose((0, 0, 0), (NAN, 0, 0, 0))])
def test_a_start_that_is_no_pose_is_refused(pose):
    with pytest.raises(InvalidInputError, match="end_effector"):
        MotionGuard(MotionLimits(max_step_m=0.1), before=pose)


def test_bounded_steps_need_a_start():
    MotionLimits(WORKSPACE, (WALL,)).require_start(None)
    MotionLimits(max_step_m=0.1).require_start(Pose.of(to()))
    with pytest.raises(InvalidInputError, match="max_step_rotation_deg") as caught:
        MotionLimits(max_step_rotation_deg=30).require_start(None)
    assert caught.value.field == "end_effector"


def test_limits_of_a_file_bound_what_they_name():
    assert MotionLimits.from_file({"motion_limits": {"max_step_m": 0.1}}) == MotionLimits(max_step_m=0.1)
    assert MotionLimits.from_file({"workspace": TASK["workspace"]}) == MotionLimits(Box((0, 0, 0), (1, 1, 1)))
    assert MotionLimits.from_file(TASK) == MotionLimits.from_task(TASK)


@pytest.mark.parametrize(
    "document",
    [{}, [], None, {"max_step_m": 0.1}, {"motion_limits": {"max_step": 0.1}}, {"motion_limits": None},
     {"motion_limits": {"keep_out": None}}, {"motion_limits": {"max_step_m": "0.1"}}],
)  # fmt: skip
def test_a_file_that_bounds_nothing_is_refused(document):
    with pytest.raises(InvalidInputError):
        MotionLimits.from_file(document)


def test_an_intersection_holds_both():
    first = MotionLimits(Box((0, 0, 0), (1, 1, 1)), (WALL,), 0.2, None, 0.02)
    second = MotionLimits(Box((0.5, -1, 0), (2, 0.5, 2)), (Box((0, 0, 0), (0.1, 0.1, 0.1)),), 0.3, 40)
    both = first.intersection(second)
    assert both == MotionLimits(Box((0.5, 0, 0), (1, 0.5, 1)), (WALL, *second.keep_out), 0.2, 40, 0.05)
    assert first.intersection(MotionLimits(hand_radius_m=0)) == first
    with pytest.raises(InvalidInputError, match="workspace"):
        first.intersection(MotionLimits(Box((2, 2, 2), (3, 3, 3))))
