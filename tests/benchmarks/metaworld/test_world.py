"""Meta-World as a world, with a small simulation in its place; and the one evaluation that drives it."""

import json
import re
import sys
from concurrent.futures import BrokenExecutor
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rich.progress import Progress
from typer.testing import CliRunner

from app.cli import application
from app.evaluation.ledger import Ledger
from app.evaluation.methods import Method
from app.evaluation.plan import Plan
from app.evaluation.run import PlanRun
from app.evaluation.sweep_run import SweepRun
from app.evaluation.sweeps import COPY, OWN_KEYFRAMES, SWEEPS
from app.executors import ForeignExecutor, call
from benchmarks.metaworld import world
from benchmarks.metaworld.world import AFTER_SUCCESS_STEPS, GRIP_STEPS, MOVE_STEPS, MetaWorld, gripper_open
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.types.poses import EndEffectorAction
from tests.benchmarks.metaworld.button_simulation import HOME_M, ButtonSimulation
from tests.e2e.processes import running_server
from tests.evaluation.test_run import InlineExecutor

FOLDER = Path(world.__file__).parent
TASK = "button-press"
HOPELESS_FROM = 500


@pytest.fixture
def simulation(monkeypatch):
    made = ButtonSimulation(hopeless_from=HOPELESS_FROM)
    monkeypatch.setattr(world, "simulation_of", lambda task: made)
    made.reset(1)
    return made


def action(position_m, *, gripper_open):
    return EndEffectorAction(np.array(position_m, dtype=float), [1.0, 0, 0, 0], gripper_open)


def beside_home_m(by_m):
    return HOME_M + np.array([by_m, 0, 0])


def executed(*actions):
    here = MetaWorld()
    return here.execute(here.view(TASK, 1), actions)


def grippers(simulation):
    return [float(command[3]) for command in simulation.commands]


def test_a_scene_shows_its_objects_and_where_the_hand_is(simulation):
    scene = MetaWorld().view(TASK, 1)
    assert (scene.instruction, [pose.name for pose in scene.objects]) == (
        "press the button",
        ["button", "pressed place"],
    )
    np.testing.assert_array_equal(scene.objects[0].position_m, simulation.button_m)
    np.testing.assert_array_equal(scene.end_effector.position_m, HOME_M)


def test_a_demonstration_ends_shortly_after_the_task_is_done(simulation):
    made = MetaWorld(control_frequency_hz=80).demonstrate(TASK, 1)
    observation, done, steps = simulation.reset(1), False, 0
    while not done:
        observation, done = simulation.step(simulation.policy(observation))
        steps += 1
    assert (made.succeeded, made.failure) == (True, "")
    assert len(made.trajectory.positions_m) == steps + AFTER_SUCCESS_STEPS
    np.testing.assert_array_equal(made.trajectory.positions_m[0], HOME_M)


def test_a_policy_that_does_not_succeed_says_so(simulation):
    made = MetaWorld().demonstrate(TASK, HOPELESS_FROM)
    assert not made.succeeded
    assert made.failure == "the scripted policy did not succeed within 150 steps"
    assert len(simulation.commands) == simulation.max_steps


@pytest.mark.parametrize(("record_hz", "every"), [(10, 8), (20, 4), (27, 3), (40, 2), (80, 1)])
def test_recordings_come_nearest_to_the_rate(simulation, record_hz, every):
    full = MetaWorld(control_frequency_hz=80).demonstrate(TASK, 1).trajectory
    made = MetaWorld().recorded_at(record_hz).demonstrate(TASK, 1)
    assert made.control_frequency_hz == 80 / every == pytest.approx(record_hz, rel=0.02)
    np.testing.assert_array_equal(made.trajectory.positions_m, full.positions_m[::every])
    np.testing.assert_array_equal(made.trajectory.joint_velocities_rad_s, full.joint_velocities_rad_s[::every])


def test_the_gripper_is_closed_when_its_fingers_are():
    commanded_at, fingers = 2, np.array([1.0, 1.0, 1.0, 0.9, 0.8, 0.6, 0.5, 0.5, 0.7, 0.9, 1.0])
    is_open = gripper_open(fingers)
    assert is_open.tolist() == [True] * 5 + [False] * 3 + [False] + [True] * 2
    assert np.flatnonzero(~is_open)[0] > commanded_at


def test_fingers_that_hardly_move_are_open():
    assert gripper_open(np.array([0.95, 1.0, 0.91])).all()
    assert not gripper_open(np.array([0.95, 1.0, 0.89])).all()


def test_going_there_and_closing_succeeds(simulation):
    there = simulation.button_m.copy()
    result = executed(action(there, gripper_open=True), action(there, gripper_open=False))
    assert (result.succeeded, result.failure) == (True, "")
    switched = grippers(simulation).index(1.0)
    assert set(grippers(simulation)[:switched]) == {-1.0}, "the hand arrives before the gripper closes"
    assert len(simulation.commands) == switched + 6, "nothing moves once the task is done"


def test_going_elsewhere_fails_after_a_settled_end(simulation):
    result = executed(action(HOME_M, gripper_open=False))
    assert (result.succeeded, result.failure) == (False, f"not solved after {2 * GRIP_STEPS} steps")
    assert grippers(simulation) == [1.0] * 2 * GRIP_STEPS


def test_a_switch_on_the_way_takes_its_time(simulation):
    executed(action(HOME_M, gripper_open=False), action(HOME_M, gripper_open=True))
    assert grippers(simulation) == [1.0] * GRIP_STEPS + [-1.0] * 2 * GRIP_STEPS


def test_a_target_out_of_reach_is_given_up(simulation):
    executed(action(beside_home_m(50), gripper_open=True))
    assert len(simulation.commands) == MOVE_STEPS + 2 * GRIP_STEPS


def test_no_more_steps_than_a_scene_has(simulation):
    executed(*(action(beside_home_m(50 * (-1) ** k), gripper_open=True) for k in range(10)))
    assert len(simulation.commands) == simulation.max_steps


@dataclass(frozen=True)
class ButtonWorld(MetaWorld):
    """In an environment of its own, which here is that of the tests."""

    python = Path(sys.executable)

    def view(self, task, seed, images=False):
        use_buttons()
        return super().view(task, seed, images)

    def demonstrate(self, task, seed, images=False):
        use_buttons()
        return super().demonstrate(task, seed, images)

    def execute(self, scene, actions):
        use_buttons()
        return super().execute(scene, actions)


def use_buttons():
    world.simulation_of = cache(lambda task: ButtonSimulation())


@pytest.fixture(scope="module")
def url(tmp_path_factory):
    with running_server(tmp_path_factory.mktemp("data"), {"ROBOPROMPT_WARM_UP": "false"}) as address:
        yield address


SETTINGS = {"workspace": {"min": [-0.6, 0.2, -0.1], "max": [0.6, 1.0, 0.6]}, "keyframes": {"rule": "merged"}}
METHODS = (OWN_KEYFRAMES, COPY, Method("noisy", COPY.options, noise=15.0, noise_on="test"))


def plan_of(*methods, episodes=3, where=None, command="roboprompt eval"):
    here = where or ButtonWorld()
    return Plan((TASK,), methods, episodes, 4, command, here, first_test_seed=here.first_test_seed, settings=SETTINGS)


def test_one_evaluation_teaches_replays_asks_and_carries_out(url, tmp_path):
    plan = plan_of(*METHODS)
    with Ledger(tmp_path / "results.jsonl") as ledger, RoboPromptClient(url) as client:
        with closing(ForeignExecutor(ButtonWorld.python)) as executor:
            (task,) = PlanRun(plan, ledger, client, executor, Progress(disable=True), shared=True)().tasks
        stored = client.get(f"/predictions/{task.trials[3].answer['id']}")
    own, asked, noisy = (task.trials[k : k + 3] for k in (0, 3, 6))
    assert task.crashes == ()
    assert len(stored["demonstration_ids"]) == 4
    assert [trial.scene.seed for trial in own] == [0, 1, 2]
    assert [trial.seed for trial in asked] == [1000, 1001, 1002]
    assert all(trial.succeeded for trial in [*own, *asked]), [trial.failure for trial in task.trials]
    assert stored["outcome"]["success"]
    assert sum(trial.succeeded for trial in noisy) < 3, "noise moves what is reported, not what is there"


def test_its_results_have_tables_and_a_page_without_pictures_of_scenes(url, tmp_path, monkeypatch):
    run = SweepRun("outside", plan_of(COPY, episodes=1), tmp_path, url=url)
    result = run(Progress(disable=True))
    assert (result.remaining, result.stopped) == (0, "")
    assert "1/1" in (tmp_path / "table.md").read_text()
    assert TASK in run.report.read_text()
    record = json.loads((tmp_path / "run.json").read_text())
    assert (record["world"], record["settings"], record["test_seeds"]) == ("metaworld", SETTINGS, [1000, 1000])


def test_an_expert_that_never_succeeds_is_an_error_of_its_trials(url, tmp_path, simulation):
    plan = plan_of(COPY, episodes=2, where=MetaWorld())
    simulation._hopeless_from = 0
    with Ledger(tmp_path / "results.jsonl") as ledger, RoboPromptClient(url) as client:
        (task,) = PlanRun(plan, ledger, client, InlineExecutor(), Progress(disable=True), shared=True)().tasks
    assert (task.trials, len(task.crashes)) == ((), 2)
    assert "TeachingError: the expert of button-press failed 4 times" in task.crashes[0].message


def die():
    sys.exit(1)


def refuse():
    raise ValueError("no")


def test_a_process_of_another_environment_that_ends_is_replaced():
    with closing(ForeignExecutor(Path(sys.executable))) as executor:
        with pytest.raises(BrokenExecutor):
            executor.submit(die).result()
        with pytest.raises(ValueError, match="no"):
            call(executor, refuse)
        assert call(executor, max, 1, 2) == 2


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (["--world", "benchmarks.nowhere"], "no module with a WORLD"),
        (["--world", "benchmarks.scenes"], "no module with a WORLD"),
        (["--settings", "{"], "not JSON"),
        (["--settings", "[]"], "not an object"),
        (["--sweep", "outside"], "own keyframes: is for another --world"),
    ],
)
def test_options_that_cannot_be(wrong, said):
    run = CliRunner().invoke(application, ["eval", *wrong])
    assert run.exit_code == 2
    assert said in " ".join(run.output.replace("\N{BOX DRAWINGS LIGHT VERTICAL}", " ").split())


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (["--task", "juggle"], "'juggle' is not one of assembly"),
        (["--recordings", "continuous"], "is for the simulated Panda alone"),
        (["--method", "replay"], "expert replay: needs the simulated Panda"),
        (["--poses", "vision"], "benchmarks.metaworld.world has no cameras"),
    ],
)
def test_options_that_another_world_does_not_have(monkeypatch, wrong, said):
    monkeypatch.setattr(MetaWorld, "python", None)
    run = CliRunner().invoke(application, ["eval", "--world", "benchmarks.metaworld.world", *wrong])
    assert run.exit_code == 2
    assert said in " ".join(run.output.replace("\N{BOX DRAWINGS LIGHT VERTICAL}", " ").split())


def test_every_task_is_evaluated_unless_some_are_named():
    assert SWEEPS["outside"].tasks == ()
    assert len(MetaWorld.tasks) == 25


def test_the_environment_has_no_server_and_its_lock_no_index():
    lines = (FOLDER / "requirements.txt").read_text().splitlines()
    pins = [line for line in lines if not line.startswith(" ")]
    assert all(re.fullmatch(r"[\w.-]+==[\w.]+ \\", line) for line in pins)
    assert all(re.fullmatch(r"    --hash=sha256:[0-9a-f]{64}( \\)?", line) for line in lines if line not in pins)
    names = {line.partition("==")[0] for line in pins}
    assert {"metaworld", "mujoco", "httpx", "packaging", "numpy"} <= names
    assert not {"fastapi", "mink", "pydantic"} & names
    assert "metaworld" not in sys.modules
