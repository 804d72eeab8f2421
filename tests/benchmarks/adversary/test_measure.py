"""Outcomes of cases are distinguished: with a real service, and a world that judges by where the hand closes."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from app.sim.outcomes import RecordedDemonstration, RolloutResult, SceneView
from benchmarks.adversary.measure import Bench, Outcome, ending_of
from benchmarks.adversary.run import Run
from benchmarks.adversary.table import shown, summary, tables
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.types.trajectory import Trajectory
from tests.benchmarks.adversary.cases import picks, poses, recording
from tests.e2e.processes import running_server

NEAR_M = 0.03


class Table:
    """A world of picks: solved where the hand closes at the red cube, but for the task `unsolvable`.

    Attributes:
        judged: how often actions were carried out.
    """

    tasks = MappingProxyType({"red": {"lid": 0.0}, "unsolvable": {"lid": 0.0}})
    first_test_seed = 100_000
    python = None
    judged = 0

    def view(self, task, seed, images=False):
        return SceneView(task, seed, "pick up the red cube", poses(np.random.default_rng(seed)), (), {})

    def demonstrate(self, task, seed, images=False):
        taught = recording(np.random.default_rng(seed), "red cube")
        scene = replace(self.view(task, seed), objects=taught.objects)
        return RecordedDemonstration(scene, taught.trajectory, 20.0, True, "")

    def execute(self, scene, actions):
        self.judged += 1
        goal = scene.objects[0].position_m
        closed = next((action for action in actions if not action.gripper_open), None)
        is_near = closed is not None and bool(np.linalg.norm(closed.position_m - goal) < NEAR_M)
        solved = is_near and scene.task != "unsolvable"
        return RolloutResult(len(actions), solved, "" if solved else "missed it")


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    settings = {"ROBOPROMPT_DEFAULT_MODEL": "nearest"}
    with running_server(tmp_path_factory.mktemp("data"), settings) as url, RoboPromptClient(url) as connected:
        yield connected


@pytest.fixture(scope="module")
def executor():
    with ThreadPoolExecutor(1) as pool:
        yield pool


@pytest.fixture
def bench(client, executor):
    def in_task(task):
        world, case = Table(), picks()
        scene = replace(world.view("red", 0), task=task, objects=case.objects)
        return Bench(client, executor, world, scene, 0)

    return in_task


@pytest.mark.parametrize(
    ("severities", "succeeded", "ending"),
    [
        ((), True, "solved"),
        ((), False, "silent"),
        (("info", "warning"), False, "silent"),
        (("warning", "danger"), False, "danger"),
        (("danger",), True, "danger"),
    ],
)
def test_only_a_danger_stops_a_robot(severities, succeeded, ending):
    assert ending_of(severities, succeeded=succeeded) == ending


def test_what_is_right_is_solved(bench):
    outcome, answer = bench("red").run("unchanged", picks())
    assert (outcome.ending, outcome.succeeded, outcome.findings) == ("solved", True, ())
    assert "action 1: (" in shown(outcome, answer)


def test_an_answer_that_fails_without_a_danger_is_silent(bench):
    outcome, _ = bench("unsolvable").run("unchanged", picks())
    assert (outcome.ending, outcome.failure) == ("silent", "missed it")


def test_an_answer_with_a_danger_is_carried_out_to_see_whether_it_was_right(bench):
    unknown = replace(picks(), instruction="shake the red cube", options={"model": "nearest", "unfamiliar": "allow"})
    outcome, _ = bench("unsolvable").run("unchanged", unknown)
    assert outcome.ending == "danger"
    assert outcome.failure == "missed it"
    assert "danger" in dict(outcome.findings).values()


def test_a_question_that_the_service_refuses(bench):
    outcome, problem = bench("red").run("unchanged", replace(picks(), instruction="juggle the red cube"))
    assert outcome.ending == "refused"
    assert problem["type"] == "/problems/unfamiliar-instruction"


def test_a_recording_that_the_service_refuses_is_uploaded_once(bench):
    case, tried = picks(), bench("red")
    still = Trajectory.from_poses(np.zeros((5, 3)), np.tile((1.0, 0.0, 0.0, 0.0), (5, 1)), np.ones(5))
    idle = replace(case, recordings=(replace(case.recordings[0], trajectory=still), *case.recordings[1:]))
    outcomes = [tried.run("unchanged", idle)[0] for _ in range(2)]
    assert {outcome.ending for outcome in outcomes} == {"refused at upload"}
    assert len(tried.taught) == 1
    assert tried.world.judged == 0


def test_equal_recordings_are_taught_once(bench):
    tried = bench("red")
    for kind in ("unchanged", "scene 0.5 cm off", "unchanged"):
        tried.run(kind, picks())
    assert len(tried.taught) == 1


def test_a_run_goes_on_where_it_was_broken_off_and_leaves_out_what_is_unsolved_unchanged(client, executor, tmp_path):
    kinds = ["unchanged", "hand lifted in all", "name in capitals in question"]
    world = Table()
    run = Run(client, executor, world, ["red", "unsolvable"], kinds, range(1), results=tmp_path / "outcomes.jsonl")
    outcomes = [outcome for outcome, _ in run()]
    assert [(o.task, o.kind) for o in outcomes] == [*(("red", kind) for kind in kinds), ("unsolvable", "unchanged")]
    assert outcomes[1].ending == "silent"  # the hand closes above the cube in every recording
    judged = world.judged
    assert [outcome for outcome, _ in run()] == outcomes
    assert world.judged == judged


def test_a_task_has_each_wrong_kind_once_over_as_many_seeds_as_kinds_are_shared_among(client, executor):
    kinds = ["unchanged", "hand shifted in half", "hand shifted in one", "gripper inverted in all"]
    run = Run(client, executor, Table(), ["red"], kinds, range(3), every=3)
    tried = [outcome.kind for outcome, _ in run()]
    assert sorted(tried) == sorted([*kinds, "unchanged", "unchanged"])


OUTCOMES = (
    Outcome("hand shifted in half", "red", 0, "silent", failure="missed it", findings=(("straying-action", "info"),)),
    Outcome("hand shifted in half", "red", 1, "danger", findings=(("scattered-demonstrations", "danger"),)),
    Outcome("gripper inverted in all", "red", 0, "silent", failure="missed it"),
    Outcome("hand shifted in one", "red", 0, "solved", succeeded=True),
    Outcome("unchanged", "red", 0, "solved", succeeded=True),
    Outcome("unchanged", "red", 1, "refused"),
)


def test_the_rates():
    assert summary(OUTCOMES) == {
        "wrong": 4,
        "silent_failures": 2,
        "silent_failure_rate": 0.5,
        "contradictory": 3,
        "contradictory_silent_failures": 1,
        "contradictory_silent_failure_rate": 0.3333,
        "detectable": 4,
        "detectable_silent_failures": 2,
        "detectable_silent_failure_rate": 0.5,
        "right": 2,
        "false_alarms": 1,
        "false_alarm_rate": 0.5,
        "right_failed_silently": 0,
    }


def test_the_tables_name_the_silent_failures_and_what_each_finding_caught():
    text = tables(OUTCOMES, "try")
    assert "| gripper inverted in all * | 1 | 0 | 0 | 0 | 0 | 1 | 100 % |" in text
    assert "| `scattered-demonstrations` | danger | 1 | 0 | 0 |" in text
    assert "| hand shifted in half | red | 0 | straying-action (info) | missed it |" in text


def test_an_outcome_can_be_read_again():
    assert [Outcome.from_json(outcome.to_json()) for outcome in OUTCOMES] == list(OUTCOMES)
