import json
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.pipeline.episode import EndEffectorAction
from app.pipeline.errors import UnsafeActionError
from app.pipeline.motion_guard import MotionGuard, action_from_json, angle_deg
from app.pipeline.motion_limits import Box, MotionLimits, Pose

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
    MotionGuard(limits).check(to(z_m=0.95))  # on top of it


def test_steps_are_bounded_between_actions():
    limits = MotionLimits(max_step_m=0.1)
    error = breach(limits, to(), to(0.15), to(0.15, 0.31))
    assert error.field == "actions[2].position"
    assert "is 0.11 m from the one before" in str(error)
    MotionGuard(limits).check(to(0.69))  # the first step has no length unless the start is known
    assert breach(limits, to(0.69), before=Pose.of(to())).field == "actions[0].position"


def test_turns_are_bounded_between_actions():
    limits = MotionLimits(max_step_rotation_deg=45)
    turned = [to(rotation=Rotation.from_euler("z", angle, degrees=True)) for angle in (0, 45, 95)]
    error = breach(limits, *turned)
    assert error.field == "actions[2].quaternion_xyzw"
    assert "turned by 50 degrees" in str(error)
    opposite = EndEffectorAction(turned[0].position_m, -turned[0].quaternion_xyzw, True)  # the same rotation
    guard = MotionGuard(limits)
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


@given(
    st.lists(st.tuples(*[st.floats(-2, 2)] * 3), min_size=1, max_size=6),
    st.floats(0.01, 1),
)
def test_whatever_passes_is_within_every_bound(places_m, max_step_m):
    keep_out = Box((0.0, 0.0, 0.8), (0.2, 0.2, 1.0))
    guard = MotionGuard(MotionLimits(WORKSPACE, (keep_out,), max_step_m))
    passed = []
    for place_m in places_m:
        try:
            guard.check(to(*place_m))
        except UnsafeActionError:
            continue
        passed.append(np.array(place_m))
    for place_m in passed:
        assert (place_m >= np.array(WORKSPACE.min_m) - 1e-9).all()
        assert (place_m <= np.array(WORKSPACE.max_m) + 1e-9).all()
        assert not ((place_m > keep_out.min_m) & (place_m < keep_out.max_m)).all()
    assert all(np.linalg.norm(b - a) <= max_step_m + 1e-8 for a, b in pairwise(passed))


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


def test_an_action_survives_the_wire():
    action = action_from_json(0, json.loads(json.dumps(GOOD)))
    assert (action.position_m.tolist(), action.quaternion_xyzw.tolist()) == (GOOD["position"], GOOD["quaternion_xyzw"])
    assert action.gripper_open is True


def test_limits_as_a_task_tells_them():
    document = {
        "workspace": {"min": [0, 0, 0], "max": [1, 1, 1]},
        "motion_limits": {
            "keep_out": [{"min": [0, 0, 0], "max": [0.1, 0.1, 0.1]}],
            "max_step_m": 0.2,
            "max_step_rotation_deg": None,
        },
    }
    limits = MotionLimits.from_task(document)
    assert limits == MotionLimits(Box((0, 0, 0), (1, 1, 1)), (Box((0, 0, 0), (0.1, 0.1, 0.1)),), 0.2, None)
