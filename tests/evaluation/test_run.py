"""A plan on a real service, the regression in place of an LLM; jobs run in this process unless a worker is needed."""

import json
from concurrent.futures import Future
from functools import cache
from operator import call

import httpx
import numpy as np
import pytest
from rich.progress import Progress

from app.evaluation.ledger import Ledger
from app.evaluation.methods import COPY, EXPERT, REGRESSION, REPLAY, Method
from app.evaluation.paper import disturbed
from app.evaluation.plan import Plan, evaluation_of
from app.evaluation.results import Crash
from app.evaluation.run import PlanRun
from app.evaluation.world import Panda
from app.sim.demonstrate import view_scene
from roboprompt_client.client import RoboPromptClient
from tests.e2e.processes import running_server

NOISY = Method("noisy", {"model": "regression"}, noise=2.0)
SPARSE = Method("uniform", {"model": "regression"}, settings={"keyframes": {"rule": "uniform", "interval": 40}})
NO_KEY = Method("no key", {"model": "openai/gpt-4o"})
SCRIPTED = Method("scripted", {"model": "scripted"})
REPLY = "I would rather not move today."
EXPERTS = ("demonstrate", "binned_keyframes")


@cache
def done(job, *arguments):
    return job(*arguments)


class InlineExecutor:
    """Runs each job at once where it is submitted, a scene's expert only once for all tests.

    `fails` names a job's arguments for which the worker breaks.
    """

    workers, description = 1, "in line"

    def __init__(self, fails=()):
        self.fails = set(fails)

    def submit(self, job, /, *arguments):
        future = Future()
        try:
            if arguments[:2] in self.fails:
                raise MemoryError("worker ran out of memory")
            future.set_result((done if job.__name__ in EXPERTS else call)(job, *arguments))
        except Exception as error:
            future.set_exception(error)
        return future

    def close(self):
        """Nothing is held."""


@pytest.fixture(scope="module")
def url(tmp_path_factory):
    environment = {
        "ROBOPROMPT_DEFAULT_MODEL": "regression",
        "ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([REPLY]),
        "ROBOPROMPT_OPENAI_API_KEY": "",
    }
    with running_server(tmp_path_factory.mktemp("data"), environment) as address:
        yield address


@pytest.fixture
def run(url, tmp_path):
    """Runs methods on open_drawer in this test's folder; returns the evaluation's only task."""

    def run_(*methods, episodes=1, demonstrations=3, fails=(), address=url, **scenes):
        plan = plan_of(*methods, episodes=episodes, demonstrations=demonstrations, **scenes)
        with Ledger(tmp_path / "results.jsonl") as ledger, RoboPromptClient(address) as client:
            PlanRun(plan, ledger, client, InlineExecutor(fails), Progress(disable=True), shared=True)()
            (task,) = evaluation_of(plan, ledger).tasks
        return task

    return run_


def plan_of(*methods, episodes=1, demonstrations=3, **scenes):
    return Plan(("open_drawer",), methods, episodes, demonstrations, "roboprompt eval", **scenes)


def lines(tmp_path):
    return [json.loads(line) for line in (tmp_path / "results.jsonl").read_text().splitlines()]


def test_every_source_of_actions(run, lessons, tmp_path):
    task = run(REGRESSION, EXPERT, REPLAY, episodes=2)
    assert [(trial.method, trial.seed) for trial in task.trials] == [
        (method.label, 100_000 + k) for method in (REGRESSION, EXPERT, REPLAY) for k in range(2)
    ]
    asked, expert, replay = task.trials[::2]
    assert (asked.answer["model"], expert.answer, replay.answer) == ("regression", None, None)
    assert all(trial.actions and trial.execution is not None for trial in task.trials)
    assert replay.succeeded, replay.failure
    assert [item.recorded.scene.seed for item in lessons[0].taught] == [0, 1, 2]
    assert {line["status"] for line in lines(tmp_path)} <= {"success", "failure"}
    assert len({line["digest"] for line in lines(tmp_path)}) == 3


def test_a_reply_without_actions_is_a_failure_with_prompt_and_reply(run):
    (trial,) = run(SCRIPTED).trials
    assert not trial.succeeded
    assert trial.execution is None
    assert trial.answer["reply_text"] == REPLY
    assert "drawer" in trial.answer["prompt"]["user"]
    assert "502" in trial.failure


def test_a_service_that_cannot_answer_is_an_error_and_is_asked_again(run, tmp_path):
    for number in (1, 2):
        task = run(REPLAY, NO_KEY, episodes=2)
        assert [trial.method for trial in task.trials] == ["expert replay"] * 2
        assert [crash.seed for crash in task.crashes] == [100_000, 100_001]
        assert "ROBOPROMPT_OPENAI_API_KEY" in task.crashes[0].message
        assert [line["status"] for line in lines(tmp_path)].count("error") == 2 * number
        assert [line["method"] for line in lines(tmp_path)].count("expert replay") == 2


def test_a_broken_worker_is_an_error_of_its_trial_only(run):
    broken = ("open_drawer", 100_001)
    task = run(REGRESSION, episodes=3, fails=[broken])
    assert [trial.seed for trial in task.trials] == [100_000, 100_002]
    assert task.crashes == (Crash(*broken, REGRESSION.label, "MemoryError: worker ran out of memory"),)
    task = run(REGRESSION, episodes=3)
    assert (len(task.trials), task.crashes) == (3, ())


def test_a_task_whose_demonstrations_cannot_be_recorded_is_an_error_of_its_trials(run):
    task = run(REGRESSION, REPLAY, fails=[("open_drawer", 2)])
    assert task.trials == ()
    assert [crash.message for crash in task.crashes] == ["MemoryError: worker ran out of memory"] * 2


def test_only_what_is_missing_is_run(run, tmp_path):
    run(REGRESSION)
    before = lines(tmp_path)
    task = run(REGRESSION, REPLAY, episodes=2)
    assert len(task.trials) == 4
    assert lines(tmp_path)[: len(before)] == before
    assert len(lines(tmp_path)) == 4
    run(REGRESSION, demonstrations=4)
    assert len(lines(tmp_path)) == 5  # other demonstrations are another configuration


def places(episode):
    """Keyframes without their bins, which follow from the task's workspace, and that from the objects."""
    return [{name: value for name, value in keyframe.items() if name != "bins"} for keyframe in episode["keyframes"]]


def test_methods_are_taught_as_they_ask(run, url):
    task = run(REGRESSION, NOISY, SPARSE)
    plain, noisy, sparse = (
        [httpx.get(f"{url}/episodes/{id_}").json() for id_ in trial.answer["demonstration_ids"]]
        for trial in task.trials
    )
    for true, moved, sampled in zip(plain, noisy, sparse, strict=True):
        assert true["extra"] == moved["extra"] == sampled["extra"]
        assert positions(true) == positions(sampled) != positions(moved)
        assert places(true) == places(moved) != places(sampled)
        assert [item["index"] % 40 for item in sampled["keyframes"][:-1]] == [0] * (len(sampled["keyframes"]) - 1)
    seed = plain[0]["extra"]["seed"]
    expected = disturbed(view_scene("open_drawer", seed, cameras=()).objects, 2.0, seed)
    assert positions(noisy[0]) == [pytest.approx(pose.position_m.tolist()) for pose in expected]


def test_continuous_recordings_and_other_scenes(run, lessons, tmp_path):
    scenes = {"world": Panda("continuous"), "first_test_seed": 1}
    task = run(EXPERT, REPLAY, COPY, episodes=2, **scenes)
    assert [item.recorded.scene.seed for item in lessons[0].taught] == [0, 3, 4]  # 1 and 2 are tested
    assert {trial.seed for trial in task.trials} == {1, 2}
    expert, again, *_ = task.trials
    assert expert.succeeded
    assert again.succeeded
    assert len(expert.actions) == 4
    for taught in lessons[0].taught:
        speeds_rad_s = np.linalg.norm(taught.recorded.trajectory.joint_velocities_rad_s, axis=1)
        assert (speeds_rad_s < 0.1).mean() < 0.4
    run(EXPERT, episodes=2, first_test_seed=1)
    digests = {line["digest"] for line in lines(tmp_path) if line["method"] == EXPERT.label}
    assert len(digests) == 2


def positions(episode):
    return [item["position"] for item in episode["objects"]]
