"""What carries the cube runs in tests and rests in demonstrations."""

import numpy as np
import pytest

from app.sim.demonstrate import rollout
from app.sim.moves import action_from_move
from app.sim.robot import SimulatedPanda
from app.sim.tasks import MOVING_TASKS, make_task
from app.sim.tasks.carrying import CARRIED, SPEEDS_M_S

SEED = 100_000
every_task = pytest.mark.parametrize("name", MOVING_TASKS)


@every_task
@pytest.mark.parametrize("variation", range(len(SPEEDS_M_S) + 1))
def test_the_cube_goes_as_fast_as_what_carries_it(name, variation):
    task = make_task(name, SEED, variation)
    robot, speed_m_s = SimulatedPanda(task, ()), (0.0, *SPEEDS_M_S)[variation]
    robot.hold(0.5)  # until it has picked up speed
    before_m = task.position_m(CARRIED)
    robot.hold(1.0)
    moved_m = task.position_m(CARRIED) - before_m
    np.testing.assert_allclose(np.linalg.norm(moved_m[:2]), speed_m_s, rtol=0.05, atol=2e-4)
    assert abs(moved_m[2]) < 1e-3
    np.testing.assert_allclose(task.position_m("carrier")[:2], task.carrier_at_m, atol=1e-3)


@every_task
def test_tests_take_the_speeds_in_turn_and_demonstrations_rest(name):
    asked = [make_task(name, seed, MOVING_TASKS[name].test_variation(seed)) for seed in range(SEED, SEED + 3)]
    assert sorted(task.speed_m_s for task in asked) == list(SPEEDS_M_S)
    assert make_task(name, SEED).speed_m_s == 0


@every_task
def test_what_picks_it_at_rest_misses_it_in_motion(name):
    actions = [action_from_move(move) for move in make_task(name, SEED).expert()]
    assert rollout(name, SEED, actions).succeeded
    for variation in (2, 3):
        assert not rollout(name, SEED, actions, variation=variation).succeeded
