"""Descent over value maps, and the actions that stand for a way."""

import numpy as np
import pytest

from app.evaluation.failures import ProgramRefusedError
from app.evaluation.voxposer import planner
from app.evaluation.voxposer.planner import ValueMaps, cost_map, plan_moves, plan_way
from app.evaluation.voxposer.sandbox import run_program
from tests.evaluation.voxposer.scenes import CUBE_M, DOWN_XYZW, SCENE, START

EVERYWHERE = [[0, 100], [0, 100], [0, 100]]


def box(low, high):
    return [[a, b] for a, b in zip(low, high, strict=True)]


def at(voxel):
    return box(voxel, [number + 1 for number in voxel])


def maps(**move):
    return ValueMaps.painted(move, DOWN_XYZW, gripper_open=True)


def test_cost_is_twice_the_distance_and_the_blurred_obstacles():
    plain = maps(affordance=[[at((50, 60, 20)), 1]])
    cost = cost_map(plain)
    assert (cost.min(), cost[50, 60, 20], cost.max()) == (0.0, 0.0, 1.0)
    far, near = cost[50, 60, 80], cost[50, 60, 50]
    assert far == pytest.approx(2 * near)
    blocked = cost_map(maps(affordance=[[at((50, 60, 20)), 1]], avoidance=[[at((50, 60, 60)), 1]]))
    # An obstacle alone weighs half as much as the way across the workspace.
    farthest = np.linalg.norm(np.array([0, 0, 99]) - (50, 60, 20))
    expected = 1 + 2 * 40 / farthest
    assert blocked[50, 60, 60] / blocked[0, 0, 99] == pytest.approx(expected / 2, rel=0.01)


def test_a_free_way_ends_at_the_target():
    way = plan_way(maps(affordance=[[at((50, 60, 20)), 1]]), np.array([30, 50, 60]))
    assert way[0].tolist() == [30, 50, 60]
    assert way[-1].tolist() == [50, 60, 20]
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).max() < 4


def test_the_nearest_of_several_targets_is_gone_to():
    way = plan_way(maps(affordance=[[at((90, 90, 20)), 1], [at((35, 50, 55)), 1]]), np.array([30, 50, 60]))
    assert way[-1].tolist() == [35, 50, 55]


def test_a_lower_affordance_is_no_target():
    way = plan_way(maps(affordance=[[at((35, 50, 55)), 0.5], [at((60, 50, 55)), 1]]), np.array([30, 50, 60]))
    assert way[-1].tolist() == [60, 50, 55]


def test_an_obstacle_is_gone_around():
    start, goal, obstacle = np.array([20, 50, 50]), (80, 50, 50), (50, 48, 50)
    free = plan_way(maps(affordance=[[at(goal), 1]]), start)
    around = plan_way(maps(affordance=[[at(goal), 1]], avoidance=[[at(obstacle), 1]]), start)
    nearest = [np.linalg.norm(way - obstacle, axis=1).min() for way in (free, around)]
    assert nearest[0] < 3
    assert nearest[1] > 8


def test_a_way_that_is_walled_in_goes_straight_to_the_target():
    wall = box((45, 0, 0), (55, 100, 100))
    way = plan_way(maps(affordance=[[at((90, 50, 50)), 1]], avoidance=[[wall, 1]]), np.array([20, 50, 50]))
    assert way[-1].tolist() == [90, 50, 50]


def planned(program):
    return plan_moves(run_program(program, SCENE), SCENE)


def test_actions_read_rotation_and_gripper_at_their_place():
    result = planned("""
cube = detect("cube")
target = empty_affordance_map()
set_voxels(target, cube)
turn = empty_rotation_map()
turn[:, :, :] = pointing_down(90)
fingers = empty_gripper_map()
set_voxels(fingers, cube.position, 0)
slow = empty_velocity_map()
slow[:, :, 0:30] = 0.5
move(target, rotation=turn, gripper=fingers, velocity=slow)
up = empty_affordance_map()
set_voxels(up, shifted(cube, 0, 0, 10))
move(up)
""")
    *way, grasp, lifted = result
    assert np.abs(grasp.position_m - CUBE_M).max() <= 0.005
    assert [action.gripper_open for action in way] == [True] * len(way)
    assert (grasp.gripper_open, lifted.gripper_open) == (False, False)  # a map left out keeps what holds
    assert abs(lifted.quaternion_xyzw @ grasp.quaternion_xyzw) == pytest.approx(1)
    assert abs(grasp.quaternion_xyzw @ np.array([0.5**0.5, 0.5**0.5, 0, 0])) == pytest.approx(1)
    assert lifted.position_m[2] - grasp.position_m[2] == pytest.approx(0.10)


def test_a_gripper_that_switches_at_once_does_so_where_the_hand_is():
    result = planned("""
target = empty_affordance_map()
set_voxels(target, detect("cube"))
fingers = empty_gripper_map()
fingers[:, :, :] = 0
move(target, gripper=fingers)
""")
    assert result[0].position_m.tolist() == START.position_m.tolist()
    assert not any(action.gripper_open for action in result)


def test_a_turn_on_the_spot_is_one_action():
    result = planned("""
target = empty_affordance_map()
set_voxels(target, hand())
turn = empty_rotation_map()
turn[:] = pointing_down(45)
fingers = empty_gripper_map()
fingers[:] = 0
move(target, rotation=turn, gripper=fingers)
""")
    (action,) = result
    assert not action.gripper_open
    assert abs(action.quaternion_xyzw @ DOWN_XYZW) < 0.95


def test_zeros_over_the_target_are_refused():
    with pytest.raises(ProgramRefusedError, match="move 1 has no target"):
        planned("t = empty_affordance_map()\nset_voxels(t, hand())\nt[0:99, :, :] = 0\nmove(t)")


def test_more_actions_than_allowed_are_refused(monkeypatch):
    monkeypatch.setattr(planner, "MAX_ACTIONS", 1)
    with pytest.raises(ProgramRefusedError, match="more than max_actions = 1 actions"):
        planned("for z in (5, 10, 15):\n    t = empty_affordance_map()\n    t[9, 9, z] = 1\n    move(t)")


def test_maps_hold_what_was_painted_last():
    painted = maps(affordance=[[EVERYWHERE, 0.2], [box((0, 0, 0), (9, 9, 9)), 1], [at((1, 2, 3)), 0.5]])
    assert painted.affordance[[50, 5, 1], [50, 5, 2], [50, 5, 3]].tolist() == pytest.approx([0.2, 1, 0.5])
    assert painted.rotation.shape == (100, 100, 100, 4)
    assert painted.gripper.min() == 1
