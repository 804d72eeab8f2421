"""Programs that people wrote for the planner of the baseline, on simulated scenes."""

from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.failures import ProgramRefusedError
from app.evaluation.sweeps import VOXPOSER_ORACLE
from app.evaluation.teach import Lesson
from app.evaluation.trials import PlannedTrial, TrialRunner
from app.evaluation.voxposer.ask import PROGRAMS, oracle_actions, oracle_program
from app.evaluation.voxposer.sandbox import run_program
from app.sim.demonstrate import view_scene
from app.sim.tasks import COMPOSITION_TASKS, TASKS
from tests.evaluation.test_run import InlineExecutor
from tests.evaluation.voxposer.scenes import SCENE

SEED = 100_000
LESSON = Lesson("push_button", 1, ())


def test_every_task_of_the_paper_has_a_program():
    assert PROGRAMS.keys() - {"common"} == TASKS.keys()


@pytest.mark.parametrize("task", ["push_multiple_buttons", "stack_cube", "place_cups"])
def test_programs_run_with_their_objects(task):
    names = TASKS[task].object_names
    objects = tuple(replace(SCENE.objects[0], name=name) for name in names)
    instruction = "first the " + ", then the ".join(names)
    moves = run_program(oracle_program(task, instruction, names), replace(SCENE, objects=objects))
    assert len(moves) >= 6


def test_objects_are_mentioned_in_the_order_of_the_instruction():
    program = oracle_program("stack_cube", "stack the yellow cube on the blue cube.", TASKS["stack_cube"].object_names)
    assert program.startswith('mentioned = ["yellow cube", "blue cube"]\n')


def trial(method, task="push_button"):
    runner = TrialRunner(None, InlineExecutor())
    return runner.run(PlannedTrial(task, SEED, method), LESSON)


def test_the_planner_presses_a_button():
    result = trial(VOXPOSER_ORACLE)
    assert result.succeeded, result.failure
    assert result.answer is None


def test_noise_on_poses_moves_the_plan(monkeypatch):
    monkeypatch.setattr(TrialRunner, "execute", lambda runner, trial, actions: replace(trial, actions=actions))
    noisy = trial(replace(VOXPOSER_ORACLE, noise=2.0))
    exact = oracle_actions(view_scene("push_button", SEED, images=False))
    assert np.linalg.norm(noisy.actions[-1].position_m - exact[-1].position_m) > 0.005


def test_a_task_without_a_program_is_a_failure_that_says_so():
    task = next(iter(COMPOSITION_TASKS))
    result = trial(VOXPOSER_ORACLE, task)
    assert not result.succeeded
    assert f"no program was written for {task}" in result.failure
    with pytest.raises(ProgramRefusedError):
        oracle_actions(view_scene(task, SEED, images=False))
