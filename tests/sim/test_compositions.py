"""What the compositions ask for is shown in parts only, and what is nearly right does not count."""

import numpy as np
import pytest

from app.pipeline.order.reading import read
from app.sim.demonstrate import rollout
from app.sim.moves import UP, action_from_move, move_to, nearest_yaw_rad, pick, place, tool_down
from app.sim.tasks import COMPOSITION_TASKS, TASKS, make_task
from app.sim.tasks.carrying import BARRIERS, PLATE
from app.sim.tasks.rearranging import BLOCKS, ClearKind
from roboprompt_client.motion.limits import USUAL_ACTIONS
from tests.sim.test_instructions import words_of

SEED = 100_000
LEFT = np.array([0.0, 1.0, 0.0])
# Of these the instruction itself is one that no demonstration has, in its words or in its form
REFUSED = {"build_tower", "press_in_order", "place_beside"}


def unseen(name, seed=SEED):
    return make_task(name, seed, COMPOSITION_TASKS[name].test_variation(seed))


def is_not_enough(name, moves):
    """Whether the arm carries the moves out, and the scene is not solved."""
    result = rollout(name, SEED, list(map(action_from_move, moves)), variation=unseen(name).variation)
    return result.num_executed == len(moves) and not result.succeeded


def test_they_stand_apart_from_the_papers_tasks():
    assert len(TASKS) == 21
    assert not TASKS.keys() & COMPOSITION_TASKS.keys()


@pytest.mark.parametrize("task", COMPOSITION_TASKS.values())
def test_no_demonstration_shows_what_is_asked(task):
    assert not set(task.SHOWN) & set(task.ASKED)
    assert 1 < len(task.SHOWN) <= 10


@pytest.mark.parametrize("name", COMPOSITION_TASKS)
def test_tests_ask_for_everything_that_is_not_shown(name):
    task = COMPOSITION_TASKS[name]
    asked = [task.test_variation(seed) for seed in range(SEED, SEED + task.test_only_variations)]
    assert sorted(asked) == list(range(task.variations, task.variations + task.test_only_variations))


@pytest.mark.parametrize("name", COMPOSITION_TASKS)
def test_instructions_reach_the_model_as_they_stand(name):
    task, (words, _) = COMPOSITION_TASKS[name], words_of(name)
    asked = [make_task(name, 0, task.variations + k).instruction for k in range(task.test_only_variations)]
    assert [read(said, words, allow_unfamiliar=True).text for said in asked] == asked
    refused = [said for said in asked if read(said, words, allow_unfamiliar=True).unfamiliar is not None]
    assert bool(refused) == (name in REFUSED)


@pytest.mark.parametrize("name", COMPOSITION_TASKS)
def test_an_answer_has_as_many_rows_as_demonstrations_have_room_for(name):
    task = COMPOSITION_TASKS[name]
    rows = [len(make_task(name, 0, k).expert()) for k in range(task.variations + task.test_only_variations)]
    shown, asked = rows[: task.variations], rows[task.variations :]
    # grammars hold a reply between the shortest and the longest demonstration
    assert min(shown) <= min(asked) <= max(asked) <= max(shown) <= USUAL_ACTIONS


def test_cubes_wait_on_the_free_pad_and_not_beside_it():
    aside = {3, 4, 5, 12, 13, 14}  # the moves that put the first cube down there and take it up again
    moves = [
        move_to(move.pose.position_m + 0.08 * LEFT, move.pose.rotation, gripper_open=move.gripper_open)
        if number in aside
        else move
        for number, move in enumerate(unseen("swap_cubes").expert())
    ]
    assert is_not_enough("swap_cubes", moves)


def test_a_lower_tower_does_not_count():
    assert is_not_enough("build_tower", unseen("build_tower").expert()[:6])


def test_the_order_of_presses_counts():
    moves = unseen("press_in_order").expert()
    assert is_not_enough("press_in_order", moves[6:] + moves[3:6] + moves[:3])


def test_the_other_side_does_not_count():
    moves = unseen("place_beside").expert()
    other_side = [
        move_to(move.pose.position_m + 0.36 * LEFT, move.pose.rotation, gripper_open=move.gripper_open)
        for move in moves[3:]
    ]
    assert is_not_enough("place_beside", moves[:3] + other_side)


def test_other_blocks_stay_where_they_are():
    name = ClearKind.name
    scene = unseen(name)
    other = next(block for block in BLOCKS if block in scene._others and block in scene._on_table)
    at, turn = scene.position_m(other), tool_down(nearest_yaw_rad(scene.yaw_rad(other), np.pi / 2))
    assert is_not_enough(name, scene.expert() + pick(at, turn) + place(at + 0.004 * UP, turn))


def test_the_way_leads_round_the_barriers_and_not_over_them():
    scene = unseen("way_round")
    moves = scene.expert()
    over = scene.position_m(PLATE) + 0.2 * UP
    up = move_to(moves[2].pose.position_m + 0.2 * UP, moves[2].pose.rotation, gripper_open=False)
    above = move_to(over, moves[2].pose.rotation, gripper_open=False)
    assert is_not_enough("way_round", [*moves[:3], up, above, *moves[-2:]])
    assert len(BARRIERS) == len(scene.open_ends)
