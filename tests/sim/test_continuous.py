"""Demonstrations as a person guides the arm: every task's succeed, and none rests where nothing happens."""

from functools import cache

import numpy as np
import pytest

from app.sim.demonstrate import record_demonstration
from app.sim.guided import ROUNDING_M, GuidedPanda, Habits
from app.sim.robot import SimulatedPanda, TrajectorySampler, measured_open
from app.sim.tasks import TASKS, make_task

SEED = 3
REST_RAD_S = 0.1  # below it the paper's rule sees a rest
REST_SAMPLES = 3
ARRAYS = ("positions_m", "quaternions_xyzw", "joint_velocities_rad_s", "gripper_open", "object_positions_m")


def newly_recorded(task, seed=SEED, **options):
    return record_demonstration(task, seed, cameras=(), recordings="continuous", **options)


recorded = cache(newly_recorded)  # for tests that only look


def speeds_rad_s(trajectory):
    return np.linalg.norm(trajectory.joint_velocities_rad_s, axis=1)


# Every second one, the others by `pytest -m long`.
SOME_OR_LONG = [pytest.param(name, marks=[pytest.mark.long] if k % 2 else []) for k, name in enumerate(TASKS)]


@pytest.mark.parametrize("name", SOME_OR_LONG)
def test_the_expert_succeeds_without_rests(name):
    demonstration = recorded(name)
    assert demonstration.succeeded, demonstration.failure
    trajectory = demonstration.trajectory
    actions = demonstration.expert_actions
    # At rest at the beginning, at the end and where something happens: elsewhere no more than a hesitation
    assert np.mean(speeds_rad_s(trajectory) < REST_RAD_S) < 0.4
    ends = np.linalg.norm(trajectory.positions_m[-1] - actions[-1].position_m)
    assert ends < 0.005
    changes = np.count_nonzero(np.diff([True, *(action.gripper_open for action in actions)]))
    assert np.count_nonzero(np.diff(trajectory.gripper_open)) == changes


@pytest.fixture(scope="module", params=["stack_cube", "turn_tap", "put_in_safe", "close_laptop"])
def guided(request):
    """The plan, the times at which its poses were passed or reached, and the trajectory."""
    robot = GuidedPanda(make_task(request.param, SEED), Habits(SEED))
    recorder = TrajectorySampler(robot)
    moves, times_s = robot.task.expert(), {}
    robot.after_move.append(lambda number: times_s.setdefault(number, robot.task.data.time))
    robot.perform(moves)
    return moves, times_s, recorder.trajectory("measured")


def free(moves):
    """The numbers of the poses that only lead to others."""
    states = [True, *(move.gripper_open for move in moves)]
    for number, move in enumerate(moves[:-1]):
        if (move.within_m is None and states[number] == states[number + 1]) or move.within_m:
            yield number


def test_no_rest_where_nothing_happens(guided):
    moves, times_s, trajectory = guided
    assert list(times_s) == list(range(len(moves)))
    numbers = list(free(moves))
    assert numbers
    for number in numbers:
        near = np.abs(trajectory.timestamps_s - times_s[number]) < 0.3
        assert np.count_nonzero(speeds_rad_s(trajectory)[near] < REST_RAD_S) < REST_SAMPLES, number


def test_free_poses_are_passed_and_the_others_reached(guided):
    moves, times_s, trajectory = guided
    for number, move in enumerate(moves):
        near = np.abs(trajectory.timestamps_s - times_s[number]) < 0.5
        away_m = np.linalg.norm(trajectory.positions_m[near] - move.pose.position_m, axis=1).min()
        assert away_m < (ROUNDING_M[1] if number in free(moves) else 0.003), number


def test_the_seed_determines_the_recording():
    first, again, other = recorded("open_drawer"), newly_recorded("open_drawer"), recorded("open_drawer", SEED + 1)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(first.trajectory, name), getattr(again.trajectory, name))
    assert len(first.trajectory) != len(other.trajectory)


def test_speed_changes_from_phase_to_phase():
    speeds = speeds_rad_s(recorded("put_in_cupboard").trajectory)
    moving = speeds[speeds > REST_RAD_S]
    peaks = np.flatnonzero((np.diff(moving)[:-1] > 0) & (np.diff(moving)[1:] <= 0)) + 1
    assert moving[peaks].max() > 2 * moving[peaks].min()


def commanded_and_measured(robot):
    """Two trajectories of one motion: the gripper as it was commanded, and as its fingers were."""
    recorder = TrajectorySampler(robot)
    robot.perform(robot.task.expert())
    return recorder.trajectory("commanded"), recorder.trajectory("measured")


def switches(trajectory):
    return np.flatnonzero(np.diff(trajectory.gripper_open)) + 1


def test_fingers_are_later_than_their_command():
    task, habits = make_task("stack_cube", SEED), Habits(SEED)
    task.way = habits.choose(task.ways)
    commanded, measured = commanded_and_measured(GuidedPanda(task, habits))
    asked, done = switches(commanded), switches(measured)
    assert len(asked) == len(done) == 2
    assert (done > asked).all()
    # The command to close comes while the hand still moves; where the fingers have closed, it is at the cube.
    closed_m = measured.positions_m[done[0] + 1]
    early_m, late_m = np.linalg.norm(measured.positions_m[[asked[0], done[0]]] - closed_m, axis=1)
    assert early_m > 2 * late_m
    assert speeds_rad_s(measured)[done[0]] < REST_RAD_S < speeds_rad_s(measured)[asked[0]]


def test_where_the_arm_rests_both_are_at_the_same_pose():
    commanded, measured = commanded_and_measured(SimulatedPanda(make_task("stack_cube", SEED), ()))
    away_m = commanded.positions_m[switches(commanded)] - measured.positions_m[switches(measured)]
    assert np.abs(away_m).max() < 0.002


@pytest.mark.parametrize(
    ("widths_mm", "expected"),
    [
        ([80, 80, 70, 60, 50, 50], [1, 1, 1, 0, 0, 0]),  # something thick
        ([80, 60, 30, 4, 4, 50, 80], [1, 1, 0, 0, 0, 1, 1]),
        ([80, 79.9, 80], [1, 1, 1]),
        ([0.2, 0.0, 0.1], [0, 0, 0]),
    ],
)
def test_fingers_are_closed_below_the_middle_between_their_extremes(widths_mm, expected):
    assert measured_open(np.array(widths_mm) / 1000).tolist() == [bool(state) for state in expected]
