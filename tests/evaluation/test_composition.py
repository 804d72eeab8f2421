"""The sweep over compositions measures the model: one that says what the expert does solves each of its tasks.

The model is a server that speaks OpenAI's HTTP API; it reads which scene is meant, and answers with the expert's poses.
"""

import re

import pytest
from rich.progress import Progress

from app.evaluation.ledger import Ledger
from app.evaluation.methods import SWEEPS, chosen
from app.evaluation.plan import Plan
from app.evaluation.results import FIRST_TEST_SEED
from app.evaluation.run import Run
from app.evaluation.server import running_server
from app.pipeline.workspace import Workspace, discretize_action
from app.sim.moves import action_from_move
from app.sim.tasks import COMPOSITION_TASKS, make_task
from roboprompt_client.client import RoboPromptClient
from tests.evaluation.copying_llm import copying_llm
from tests.evaluation.test_run import InlineExecutor

MODEL = "openai_compatible/solver"
SWEEP = SWEEPS["composition"]
QUERY = re.compile(r"\{[^{}]*'([^']*)'\}>\Z")


def unseen(task):
    return make_task(task, FIRST_TEST_SEED, COMPOSITION_TASKS[task].test_variation(FIRST_TEST_SEED))


class Solver:
    """Replies with the expert's poses, as integers of the task's workspace."""

    def __init__(self):
        self.scenes = {(scene := unseen(task)).instruction: scene for task in COMPOSITION_TASKS}
        self.client = None

    def __call__(self, message):
        scene = self.scenes[QUERY.search(message)[1]]
        box = self.client.get(f"/tasks/{scene.name}")["workspace"]
        workspace = Workspace(box["min"], box["max"])
        return str([list(discretize_action(action_from_move(move), workspace).bins) for move in scene.expert()])


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    """The service's client, and what its LLM was asked."""
    solver = Solver()
    with copying_llm(solver) as (llm, asked):
        environment = {"ROBOPROMPT_DEFAULT_MODEL": MODEL, "ROBOPROMPT_COMPATIBLE_BASE_URL": llm}
        with running_server(tmp_path_factory.mktemp("data"), environment) as url, RoboPromptClient(url) as client:
            solver.client = client
            yield client, asked


def run(client, folder, task, methods, demonstrations):
    plan = Plan((task,), methods, 1, demonstrations, "roboprompt eval")
    with Ledger(folder / "results.jsonl") as ledger:
        (taught,) = Run(plan, ledger, client, InlineExecutor(), Progress(disable=True))().tasks
    assert not taught.crashes
    return taught.trials


@pytest.mark.parametrize("demonstrations", [1, pytest.param(10, marks=pytest.mark.long)])
@pytest.mark.parametrize("task", COMPOSITION_TASKS)
def test_the_right_answer_succeeds(service, tmp_path, task, demonstrations):
    client, asked = service
    (method,) = chosen(SWEEP.with_models([MODEL]), [MODEL], [])
    (trial,) = run(client, tmp_path, task, (method,), demonstrations)
    assert trial.succeeded, trial.failure
    system, user = (message["content"] for message in asked[-1][1]["messages"])
    assert "Franka" in system
    scene = unseen(task)
    assert all(f"'{name}': [" in user[user.rindex("{") :] for name in scene.object_names)
    assert user.count(">[[") == demonstrations
