"""The geometry of a Franka arm; and a plan is shown with what is wrong with it before anything moves."""

import numpy as np
import pytest
from arms import Service

from roboprompt_client import EndEffectorAction, PredictedActions, RoboPromptError, UnsafeActionError, run_task
from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.driver import ArmState, Calibration
from roboprompt_client.arms.named import LIMITS_RAD, PandaGeometry, flange, franka_hand
from roboprompt_client.arms.preview import preview_plan
from roboprompt_client.commands.shared import Person, plan_table
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.types import quaternions as rotations

DOWN = np.array([1.0, 0, 0, 0])
BASE_M = np.array([-0.3, 0.0, 0.75])
AT_BASE = Calibration(BASE_M, rotations.IDENTITY)
READY = PandaGeometry().ready_rad
NO_LIMITS = MotionLimits(hand_radius_m=0.0)


def test_the_ready_pose():
    """libfranka's examples start there; the flange is 0.3069 m ahead and 0.5903 m up."""
    frame, _ = flange(READY)
    np.testing.assert_allclose(frame[:3, 3], [0.3069, 0, 0.5903], atol=1e-4)
    np.testing.assert_allclose(frame[:3, 2], [0, 0, -1], atol=1e-9)


def test_the_jacobian_is_the_derivative():
    joints = np.random.default_rng(0).uniform(*map(np.array, LIMITS_RAD["panda"]))
    frame, jacobian = flange(joints)
    for k in range(7):
        step = np.eye(7)[k] * 1e-6
        there, _ = flange(joints + step)
        np.testing.assert_allclose((there[:3, 3] - frame[:3, 3]) / 1e-6, jacobian[:3, k], atol=1e-5)
        turn = rotations.to_rotation_vector(rotations.from_matrix(there[:3, :3] @ frame[:3, :3].T))
        np.testing.assert_allclose(turn / 1e-6, jacobian[3:, k], atol=1e-4)


def test_a_reachable_pose_is_reached():
    tip = np.eye(4)
    tip[2, 3] = 0.1034
    joints = PandaGeometry("fr3", tip).way(READY, np.array([0.45, 0.15, 0.2]), DOWN)
    frame, _ = flange(joints)
    np.testing.assert_allclose((frame @ tip)[:3, 3], [0.45, 0.15, 0.2], atol=1e-3)


@pytest.mark.parametrize(
    ("position_m", "message"),
    [
        ((1.2, 0, 0.4), "out of reach: 1.2"),
        ((-0.5, 0.0, 0.3), r"joint \d would come to|out of reach"),
        ((0.05, 0.0, 0.1), r"joint \d would come to|out of reach"),
    ],
)
def test_what_is_out_of_reach_is_refused_before_it_moves(position_m, message):
    with pytest.raises(MotionError, match=message):
        PandaGeometry("fr3", np.eye(4)).way(READY, np.array(position_m), DOWN)


def test_a_joint_s_limit_is_named():
    turned = rotations.product(rotations.about_z(2.5), DOWN)
    with pytest.raises(MotionError, match=r"joint 7 would come to .* after \d+ % of the way"):
        PandaGeometry("fr3", np.eye(4)).way(READY, flange(READY)[0][:3, 3], turned)


def to(x_m, y_m, z_m, quaternion=DOWN):
    """An action, its position given from the base."""
    return EndEffectorAction(BASE_M + np.array([x_m, y_m, z_m]), quaternion, True)


def test_the_joints_are_followed_from_pose_to_pose():
    geometry = PandaGeometry("panda")
    plan = [to(0.45, 0.15, 0.2), to(0.45, 0.15, 0.1)]
    one, two = preview_plan(plan, AT_BASE, NO_LIMITS, geometry=geometry, joints_rad=READY)
    assert (one.reachable, two.reachable, one.warning, two.warning) == (True, True, "", "")
    assert one.from_base_m == pytest.approx(np.linalg.norm([0.45, 0.15, 0.2]))
    joints = geometry.way(READY, np.array([0.45, 0.15, 0.2]), DOWN)
    assert one.nearest == pytest.approx(geometry.nearest_limit(joints))
    joints = geometry.way(joints, np.array([0.45, 0.15, 0.1]), DOWN)
    np.testing.assert_allclose((flange(joints)[0] @ franka_hand())[:3, 3], [0.45, 0.15, 0.1], atol=1e-3)
    assert two.nearest == pytest.approx(geometry.nearest_limit(joints))


def test_what_cannot_be_reached_says_why_and_the_rest_is_looked_at():
    turned = rotations.product(rotations.about_z(-2.6), DOWN)
    plan = [to(1.2, 0, 0.4), to(0.4, 0, 0.3, turned), to(0.45, 0.1, 0.2)]
    far, twisted, fine = preview_plan(plan, AT_BASE, NO_LIMITS, geometry=PandaGeometry(), joints_rad=READY)
    assert "out of reach: 1.2" in far.warning
    assert twisted.warning.startswith("joint 7 would come to")
    assert (far.reachable, far.nearest, twisted.reachable, fine.reachable) == (False, None, False, True)


def test_the_joint_that_is_nearest_to_its_limit():
    geometry = PandaGeometry("panda")
    low, high = np.array(LIMITS_RAD["panda"])
    middle = (low + high) / 2
    for joint, off_deg in ((2, 15.0), (6, -3.0)):
        joints = middle.copy()
        joints[joint - 1] = (low if joint == 2 else high)[joint - 1] + np.radians(off_deg) * (1 if joint == 2 else -1)
        assert geometry.nearest_limit(joints) == (joint, pytest.approx(off_deg))


def test_boxes_on_the_way_are_named_by_the_rule_that_refuses_them():
    box = Box((-0.05, -0.05, 0.7), (0.05, 0.05, 0.9))
    left, right, beside = (EndEffectorAction([x, y, 0.8], DOWN, True) for x, y in ((-0.3, 0), (0.3, 0), (0.3, 0.3)))
    known = (Calibration.none(), MotionLimits(keep_out=(box,), hand_radius_m=0.05))
    shown = preview_plan([left, right, beside], *known, start_m=[-0.3, 0.3, 0.8])
    assert [item.touches for item in shown] == [(), (box,), ()]
    assert "the way touches the box -0.05 -0.05 0.7 to 0.05 0.05 0.9 m" in shown[1].warning
    assert preview_plan([right], *known)[0].touches == ()
    assert preview_plan([right], *known, start_m=[-0.3, 0, 0.8])[0].touches == (box,)


def test_without_joints_the_reach_is_not_known():
    unknown = preview_plan([to(0.9, 0, 0.3)], AT_BASE, NO_LIMITS, geometry=PandaGeometry())[0]
    assert (unknown.reachable, unknown.nearest, unknown.warning) == (None, None, "")
    assert unknown.cells(1)[4:6] == ("not known", "not known")


def test_the_table_has_a_row_for_each_action_and_warnings_below():
    plan = [to(0.45, 0, 0.2), to(1.2, 0, 0.4)]
    lines = plan_table(preview_plan(plan, AT_BASE, NO_LIMITS, geometry=PandaGeometry(), joints_rad=READY)).splitlines()
    assert lines[0].split("  ")[0] == "action"
    assert lines[1].startswith("1       0.150 0.000 0.950")
    assert " yes " in lines[1]
    assert " NO " in lines[2]
    assert lines[3].startswith("! action 2: the pose is out of reach")


def test_another_model_is_refused():
    with pytest.raises(InvalidInputError, match="model"):
        PandaGeometry("ur5")


class Ready:
    """A driver at its ready pose, that never moves."""

    name, proven = "ready", "a test"

    def __init__(self):
        self.commands = []

    def state(self):
        tip = flange(READY)[0] @ franka_hand()
        return ArmState(tip[:3, 3], DOWN, READY, np.zeros(7), 0.08)

    def geometry(self):
        return PandaGeometry("panda")

    def __getattr__(self, name):
        return lambda *given, **named: self.commands.append(name)


BOX = Box((-0.05, -0.05, 0.8), (0.0, 0.05, 1.2))


def shown_to(driver, plan, limits=MotionLimits(), cell=NO_LIMITS):  # noqa: B008
    """Run a plan with an arm at its ready pose; return the error."""
    arm = Arm(driver, calibration=AT_BASE, limits=cell)
    service = Service(PredictedActions("p", tuple(plan), {"findings": []}), limits)
    with pytest.raises(RoboPromptError) as caught:
        run_task(service, arm, "t", "go", preview=Person(arm).preview, confirm=lambda *_: pytest.fail("asked"))
    assert driver.commands == ["halt"]
    return caught.value


def test_a_plan_is_shown_before_it_is_refused(capsys):
    limits = MotionLimits(Box((-1, -1, 0), (2, 1, 2)), keep_out=(BOX,), hand_radius_m=0.05)
    assert isinstance(shown_to(Ready(), [to(0.2, 0, 0.3)], limits), UnsafeActionError)
    assert "! action 1: the way touches the box" in capsys.readouterr().err


def test_a_plan_that_ends_out_of_reach_is_shown_and_not_begun(capsys):
    error = shown_to(Ready(), [to(0.45, 0, 0.4), to(1.2, 0, 0.4)])
    assert isinstance(error, MotionError)
    assert str(error).startswith("action 2 of the plan: the pose is out of reach: 1.2")
    assert capsys.readouterr().err.splitlines()[0].startswith("action  position, m")


def test_a_plan_that_ends_beyond_the_cell_s_limits_is_not_begun():
    cell = MotionLimits(Box((-1, -1, 0.8), (1, 1, 2)), hand_radius_m=0.0)
    assert "action 1: position.z" in str(shown_to(Ready(), [to(0.45, 0, 0.4), to(0.45, 0, 0.0)], cell=cell))


class Unknown(Ready):
    """A driver that knows no geometry, but whether a pose can be reached."""

    def geometry(self):
        return None

    def check(self, position_m, quaternion_xyzw):
        if np.linalg.norm(position_m) > 0.8:
            raise MotionError("the controller says no")


def test_the_poses_of_a_plan_are_all_asked_of_a_driver_without_geometry():
    error = shown_to(Unknown(), [to(0.45, 0, 0.4), to(0.9, 0, 0.4)])
    assert str(error) == "action 2 of the plan: the controller says no; nothing was moved"


def test_a_plan_may_be_as_long_as_was_asked_for():
    Arm(Unknown(), calibration=AT_BASE).check_plan([to(0.45, 0, 0.4)] * 101)


def test_of_another_robot_nothing_is_known(capsys):
    Person(object(), "http://lab").preview([to(0.4, 0, 0.4)], NO_LIMITS, "p1")
    said = capsys.readouterr().err
    assert "no preview" in said
    assert "http://lab/ui/predictions/p1\n" in said
