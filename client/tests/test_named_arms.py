"""Arms whose geometry is known by name."""

from typing import get_args

import numpy as np
import pytest
from makers import Body, open_ur

from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.named import UR_GRIPPER_M, ArmModel, named_geometry
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.poses import EndEffectorAction

MODELS = get_args(ArmModel)


@pytest.mark.parametrize("model", MODELS)
def test_a_ready_arm_points_down_before_its_base_and_goes_straight(model):
    arm = named_geometry(model)
    hand = arm.hand(arm.ready_rad)
    np.testing.assert_allclose(hand[:3, 2], [0, 0, -1], atol=1e-9)
    assert hand[0, 3] > 0.25
    goal_m = hand[:3, 3] + [0.05, 0.1, -0.05]
    joints = arm.way(arm.ready_rad, goal_m, rotations.from_matrix(hand[:3, :3]))
    np.testing.assert_allclose(arm.hand(joints)[:3, 3], goal_m, atol=1e-3)


@pytest.mark.parametrize(("model", "reach_m"), [("ur3e", 0.5), ("ur5e", 0.85), ("ur10e", 1.3), ("ur16e", 0.9)])
def test_the_reach_is_about_the_maker_s(model, reach_m):
    """Universal Robots' technical sheets; the makers' points on the wrist differ from ours by up to 9 cm."""
    arm = named_geometry(model)
    stretched = arm.skeleton(np.array([np.pi, 0, 0, 0, 0, 0]))
    wrist_m = stretched[-3] - stretched[1]  # from the shoulder to where the second and the third wrist axis meet
    assert np.linalg.norm(wrist_m) == pytest.approx(reach_m, abs=0.09)


def test_a_ur_of_a_known_model_is_previewed_with_its_tool(monkeypatch):
    body = Body()
    body.tool[2, 3] = 0.1
    driver = open_ur(body, monkeypatch, model="ur5e")
    named = named_geometry("ur5e")
    lower_m = driver.geometry().hand(named.ready_rad)[2, 3] - named.hand(named.ready_rad)[2, 3]
    assert lower_m == pytest.approx(UR_GRIPPER_M - 0.1)
    assert open_ur(body, monkeypatch).geometry() is None
    here = driver.geometry().hand(driver.state().joint_positions_rad)
    action = EndEffectorAction(here[:3, 3] + [0, 0.02, 0.02], rotations.from_matrix(here[:3, :3]), True)
    (row,) = Arm(driver).preview([action], MotionLimits())
    assert row.reachable
    assert row.nearest.margin_deg > 90
    with pytest.raises(InvalidInputError, match="model: is 'ur5' \\(valid: ur3e, ur5e, ur10e, ur16e\\)"):
        open_ur(body, monkeypatch, model="ur5")
