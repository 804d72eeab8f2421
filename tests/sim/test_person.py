import numpy as np
import pytest

from app.sim.guided import HESITATION_SPEED_M_S, OVERSHOOT_M, TOOL_SPEED_M_S, Habits
from app.sim.motion import Route
from app.sim.moves import ToolPose, move_to, pick, tool_down
from app.sim.tasks import TASKS, make_task

HOME = ToolPose(np.array([0.0, 0.0, 1.2]), tool_down())
PICK = pick([0.3, 0.1, 0.8], tool_down())
SEEDS = range(40)


def steps(seed, moves=PICK):
    return Habits(seed).steps(HOME, True, moves)


def route(*ends_m):
    along_m = np.linspace(0, ends_m[-1], 400)
    return Route(np.zeros((400, 7)), along_m, ends_m)


def test_what_a_move_says_goes_before():
    moves = [move_to(at, tool_down(), gripper_open=False, within_m=within_m) for at, within_m in
             zip(([0.1, 0, 1], [0.2, 0, 1], [0.3, 0, 1]), (0.004, 0.0, 0.02), strict=True)]  # fmt: skip
    assert [step.within_m for step in steps(0, moves)] == [0.004, 0.0, 0.0]


def test_many_grasps_are_overshot_and_corrected():
    overshoots = [found[0] for found in map(steps, SEEDS) if found[0].number is None]
    assert 0.4 * len(SEEDS) < len(overshoots) < len(SEEDS)
    heading = np.array([0.3, 0.1, 0]) / np.hypot(0.3, 0.1)
    for step in overshoots:
        beyond = step.move.pose.position_m - PICK[0].pose.position_m
        assert OVERSHOOT_M[0] <= beyond @ heading <= OVERSHOOT_M[1]
        np.testing.assert_allclose(beyond, beyond @ heading * heading, atol=1e-12)
        assert step.within_m < OVERSHOOT_M[0]


def test_speeds_have_phases_and_hesitations_far_from_where_something_happens():
    hesitations = 0
    for seed in SEEDS:
        way = route(0.3, 0.8)
        speeds = Habits(seed).speeds_m_s(way)
        slow = speeds <= HESITATION_SPEED_M_S
        hesitations += slow.any()
        for end_m in (0.0, *way.ends_m):
            assert not slow[np.abs(way.along_m - end_m) < 0.04].any()
        assert 0.2 * TOOL_SPEED_M_S < speeds[~slow].min() < 0.8 * speeds.max() <= 1.2 * TOOL_SPEED_M_S
    assert 0.3 * len(SEEDS) < hesitations < len(SEEDS)


@pytest.mark.parametrize("name", [name for name, task in TASKS.items() if task.ways > 1])
def test_ways_differ_and_the_first_is_the_default(name):
    task = make_task(name, 0)
    assert task.way == 0
    plans = []
    for way in range(task.ways):
        task.way = way
        poses = [move.pose for move in task.expert()]
        plans.append(np.array([[*pose.position_m, *pose.rotation.as_rotvec()] for pose in poses]))
    assert len(plans) == 2
    assert np.abs(plans[0] - plans[1]).max() > 0.03
