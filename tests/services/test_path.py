"""The path of a recorded prediction, as its page previews it."""

import numpy as np
import pytest

from app.services.predict.evidence import path_of
from app.services.task_settings import TaskSettings
from roboprompt_client.arms.panda import PandaGeometry
from tests.services.test_explain_prediction import DOWN, actions, cube, prediction

BASE = {"robot_base": [-0.3, 0.0, 0.75]}
HAND = {"position": [0.0, 0.0, 1.2], "quaternion_xyzw": DOWN}


def path(predicted, request=None, **settings):
    return path_of(prediction(predicted, cube(0.1), request=request or {}), TaskSettings(**BASE, **settings))


def test_without_an_arm_distances_alone_are_known():
    shown = path(actions(0.2))
    assert [item.from_base_m for item in shown] == pytest.approx(
        [np.linalg.norm(np.array(position) - BASE["robot_base"]) for position, _, _ in actions(0.2)]
    )
    assert {(item.reachable, item.nearest) for item in shown} == {(None, None)}


def test_the_arm_comes_from_its_ready_pose_to_where_the_request_says_it_is():
    geometry = PandaGeometry("panda")
    first = path(actions(0.2), {"end_effector": HAND}, arm="panda")[0]
    joints = geometry.way(geometry.ready_rad, np.array([0.3, 0, 0.45]), np.array(DOWN))
    joints = geometry.way(joints, np.array(actions(0.2)[0][0]) - BASE["robot_base"], np.array(DOWN))
    assert (first.reachable, first.nearest) == (True, geometry.nearest_limit(joints))


@pytest.mark.parametrize("request_", [{}, {"end_effector": {**HAND, "position": [9.0, 0.0, 1.2]}}])
def test_what_is_out_of_reach_says_so_wherever_the_hand_is_said_to_be(request_):
    near, far, again = path([*actions(0.2)[:1], *actions(2.0)[:1], *actions(0.2)[2:]], request_, arm="fr3")
    assert (near.reachable, far.reachable, again.reachable) == (True, False, True)
    assert "out of reach" in far.problem


def test_today_s_boxes_are_held_against_the_way():
    box = {"min": [0.3, 0.0, 0.7], "max": [0.4, 0.2, 1.0]}
    limits = {"keep_out": [box], "hand_radius_m": 0.01}
    aside, through = path([*actions(0.2)[:1], *actions(0.5)[:1]], motion_limits=limits)
    assert (aside.touches, [list(item.min_m) for item in through.touches]) == ((), [box["min"]])


def test_a_prediction_without_actions_has_no_path():
    assert path_of(prediction([], cube(0.1), actions=None), TaskSettings()) == ()
