import pickle

import numpy as np
import pytest

from app.pipeline.keyframes import Motion, merged
from app.sim.demonstrate import record_demonstration, rollout, view_scene
from app.sim.moves import tool_down
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import EndEffectorAction

OUT_OF_REACH = EndEffectorAction([0.7, 0.5, 1.6], tool_down().as_quat(), True)
HARMLESS = EndEffectorAction([0.1, 0.0, 1.2], tool_down().as_quat(), True)


def test_a_demonstration_survives_pickling():
    demonstration = record_demonstration("push_button", 2)
    copy = pickle.loads(pickle.dumps(demonstration))
    assert copy.scene.instruction == "push the green button"
    np.testing.assert_array_equal(copy.trajectory.positions_m, demonstration.trajectory.positions_m)
    np.testing.assert_array_equal(copy.scene.frames[0].rgb, demonstration.scene.frames[0].rgb)


def test_the_demonstration_starts_from_the_scene_that_is_shown():
    demonstration, scene = record_demonstration("stack_cube", 3), view_scene("stack_cube", 3)
    for shown, recorded in zip(scene.objects, demonstration.scene.objects, strict=True):
        np.testing.assert_array_equal(shown.position_m, recorded.position_m)
    np.testing.assert_array_equal(scene.frames[0].rgb, demonstration.scene.frames[0].rgb)


def test_the_wrong_variation_fails():
    actions = expert_actions("push_button", 0)
    other = rollout("push_button", 0, actions, variation=1)
    assert not other.succeeded
    assert other.num_executed == len(actions)
    assert "not solved" in other.failure


def test_a_rollout_reports_the_action_that_cannot_be_reached():
    result = rollout("push_button", 0, [HARMLESS, OUT_OF_REACH])
    assert (result.succeeded, result.num_executed) == (False, 0)
    assert "action 2 of 2" in result.failure


def test_no_actions_solve_nothing():
    result = rollout("open_drawer", 0, [])
    assert (result.succeeded, result.num_executed) == (False, 0)


@pytest.mark.parametrize("call", [view_scene, record_demonstration])
def test_an_unknown_task_is_refused_with_those_there_are(call):
    with pytest.raises(InvalidInputError, match="push_button, stack_cube, open_drawer"):
        call("fold_laundry", 0)


def expert_actions(task_name, seed):
    trajectory = record_demonstration(task_name, seed, cameras=()).trajectory
    return [trajectory.action_at(frame) for frame in merged(Motion.of(trajectory))]
