"""The sweep over compositions measures the model: one that says what the expert does solves each of its tasks.

The model is a server that speaks OpenAI's HTTP API; it reads which scene is meant, and answers with the expert's poses.
"""

import re

import pytest
from rich.progress import Progress

from app.evaluation.ledger import Ledger
from app.evaluation.methods import EMBEDDED, SWEEPS, WHOLE_SCENE, chosen
from app.evaluation.plan import Plan
from app.evaluation.results import FIRST_TEST_SEED, Method
from app.evaluation.run import Run
from app.evaluation.server import running_server
from app.pipeline.workspace import Workspace, discretize_action
from app.sim.moves import action_from_move
from app.sim.tasks import COMPOSITION_TASKS, make_task
from roboprompt_client.client import RoboPromptClient
from tests.evaluation.copying_llm import copying_llm
from tests.evaluation.test_run import InlineExecutor

MODEL = "openai_compatible/solver"
BY_ITSELF = Method("default")
# Where the instruction is unlike those of the demonstrations; elsewhere it is the scene that differs.
REFUSED = {"build_tower", "press_in_order", "place_beside"}
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
        if not (query := QUERY.search(message)):
            return "none"  # asked which of the taught instructions is meant
        scene = self.scenes[query[1]]
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
def test_the_right_answer_succeeds_where_it_is_allowed(service, tmp_path, task, demonstrations):
    client, asked = service
    (method,) = chosen(SWEEP.with_models([MODEL]), [MODEL], [])
    allowed, by_itself = run(client, tmp_path, task, (method, BY_ITSELF), demonstrations)
    assert allowed.succeeded, allowed.failure
    assert by_itself.execution is None
    assert by_itself.refused == (task in REFUSED)
    prompt = allowed.answer["prompt"]
    assert "Franka" in prompt["system"]
    assert prompt["user"] in [body["messages"][-1]["content"] for _, body in asked]
    query = prompt["user"][prompt["user"].rindex("{") :]
    assert all(f"'{name}': [" in query for name in COMPOSITION_TASKS[task].object_names)
    assert prompt["user"].count(">[[") == demonstrations


def test_models_are_asked_alike_and_the_yardsticks_have_no_other_rules():
    *models, by_itself, copy, regression, replay = SWEEP.with_models([MODEL])
    assert [method.options["model"] for method in models] == [*EMBEDDED, MODEL]
    assert all(method.options == {**WHOLE_SCENE, "model": method.options["model"]} for method in models)
    assert by_itself == Method("default", {"model": MODEL})
    assert all(method.options["unfamiliar"] == "allow" for method in (copy, regression))
    assert chosen(SWEEP.with_models([]), ["nearest", "replay"], []) == (copy, replay)
