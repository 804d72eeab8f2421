"""What single tasks have of their own: sequences of presses, whose order counts, and a socket that holds its plug."""

from app.pipeline.keyframes import Motion, merged
from app.sim.demonstrate import record_demonstration, rollout
from app.sim.moves import action_from_move
from app.sim.robot import SimulatedPanda
from app.sim.tasks import make_task
from app.sim.tasks.buttons import MAX_PRESSES, SEQUENCES, PushMultipleButtons

NAME = PushMultipleButtons.name
YELLOW_THEN_RED = SEQUENCES.index(("yellow", "red"))
RED_TWICE = SEQUENCES.index(("red", "red"))


def expert_actions(variation):
    return [action_from_move(move) for move in make_task(NAME, 0, variation).expert()]


def test_tests_ask_for_one_to_six_presses():
    sequences = [SEQUENCES[PushMultipleButtons.test_variation(seed)] for seed in range(100_000, 100_100)]
    assert {len(sequence) for sequence in sequences} == set(range(1, MAX_PRESSES + 1))
    assert len(set(sequences)) > 60


def test_the_longest_sequence_succeeds():
    longest = SEQUENCES.index(("red", "yellow", "green", "blue", "red", "red"))
    demonstration = record_demonstration(NAME, 1, variation=longest, cameras=())
    assert demonstration.succeeded, demonstration.failure
    assert len(merged(Motion.of(demonstration.trajectory))) == len(demonstration.expert_actions)


def test_the_order_and_the_number_of_presses_count():
    yellow_then_red, red_twice = expert_actions(YELLOW_THEN_RED), expert_actions(RED_TWICE)
    assert rollout(NAME, 0, yellow_then_red, variation=YELLOW_THEN_RED).succeeded
    assert rollout(NAME, 0, red_twice, variation=RED_TWICE).succeeded
    wrong_order = yellow_then_red[3:] + yellow_then_red[:3]
    assert not rollout(NAME, 0, wrong_order, variation=YELLOW_THEN_RED).succeeded
    assert not rollout(NAME, 0, red_twice[:3], variation=RED_TWICE).succeeded


def test_grasping_the_plug_does_not_unplug_it():
    task = make_task("unplug_cable", 0)
    above, grasp, out, _ = task.expert()
    robot = SimulatedPanda(task, cameras=())
    plugged_m = task.position_m("cable")
    robot.perform([above, grasp])
    assert task.events == []
    assert abs(task.position_m("cable") - plugged_m).max() < 0.002
    robot.perform([out])
    assert task.events == ["unplugged"]
    assert task.succeeded()
