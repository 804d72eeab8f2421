import numpy as np
import pytest

from benchmarks.metaworld.execute import GRIP_STEPS, MOVE_STEPS, execute
from tests.benchmarks.metaworld.button_world import HOME_M, ButtonWorld


def action(position, *, gripper_open):
    return {"position": list(position), "gripper_open": gripper_open, "quaternion_xyzw": [1, 0, 0, 0]}


def beside_home_m(by_m):
    return HOME_M + np.array([by_m, 0, 0])


@pytest.fixture
def world():
    made = ButtonWorld()
    made.reset(1)
    return made


def grippers(world):
    return [float(command[3]) for command in world.commands]


def test_going_there_and_closing_succeeds(world):
    done, steps = execute(
        world, 1, [action(world.button_m, gripper_open=True), action(world.button_m, gripper_open=False)]
    )
    assert done
    assert steps == len(world.commands)
    switched = grippers(world).index(1.0)
    assert set(grippers(world)[:switched]) == {-1.0}, "the hand arrives before the gripper closes"
    assert steps == switched + 6, "nothing moves once the task is done"


def test_going_elsewhere_fails_after_a_settled_end(world):
    done, steps = execute(world, 1, [action(HOME_M, gripper_open=False)])
    assert not done
    assert steps == 2 * GRIP_STEPS
    assert set(grippers(world)) == {1.0}


def test_a_switch_on_the_way_takes_its_time(world):
    execute(world, 1, [action(HOME_M, gripper_open=False), action(HOME_M, gripper_open=True)])
    assert grippers(world) == [1.0] * GRIP_STEPS + [-1.0] * 2 * GRIP_STEPS


def test_a_target_out_of_reach_is_given_up(world):
    far_m = beside_home_m(9.0)
    _, steps = execute(world, 1, [action(far_m, gripper_open=True)])
    assert steps == MOVE_STEPS + 2 * GRIP_STEPS
    assert np.abs(world.commands).max() == 1.0


def test_steps_end_with_the_scene(world):
    targets = [action(beside_home_m(9.0 * (-1) ** k), gripper_open=True) for k in range(5)]
    assert execute(world, 1, targets) == (False, world.max_steps)


def test_precision_is_for_where_it_counts(world):
    there_m = beside_home_m(0.1)
    execute(world, 1, [action(there_m, gripper_open=True), action(HOME_M, gripper_open=True)])
    forth = sum(command[0] > 0 for command in world.commands)
    execute(world, 1, [action(there_m, gripper_open=False), action(HOME_M, gripper_open=True)])
    before_closing = grippers(world).index(1.0)
    # the remaining way shrinks by a tenth in every step: to 1 cm and to 0.5 cm of 10 cm
    assert (forth, before_closing) == (22, 29)


def test_no_actions_do_nothing(world):
    assert execute(world, 1, []) == (False, 0)
