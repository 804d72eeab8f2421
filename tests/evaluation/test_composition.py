"""The sweep over compositions measures the model: one that says what the expert does solves each of its tasks.

The model is a server that speaks OpenAI's HTTP API; it reads which scene is meant, and answers with the expert's poses.
"""

import json
import re

import numpy as np
import pytest
from rich.progress import Progress

from app.evaluation.ledger import Ledger
from app.evaluation.methods import EMBEDDED, OPEN, SWEEPS, Method, chosen
from app.evaluation.plan import Plan, evaluation_of
from app.evaluation.run import PlanRun
from app.evaluation.server import running_server
from app.evaluation.teach import suffix_of
from app.evaluation.world import Panda
from app.pipeline.workspace import Workspace, discretize_actions
from app.sim.moves import action_from_move
from app.sim.tasks import COMPOSITION_TASKS, make_task
from app.sim.tasks.rearranging import BLOCKS
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
    return make_task(task, Panda.first_test_seed, COMPOSITION_TASKS[task].test_variation(Panda.first_test_seed))


def swap_steps(scene):
    (first, second), pad = scene.combination
    carried = (first, pad), (second, f"where {first} was"), (first, f"where {second} was")
    return [step for cube, place in carried for step in (f"grasp {cube}", f"release {place}")]


def clear_steps(scene):
    beside = ("7 cm ahead of", "{} ahead of and {} left of", "{} behind and {} left of")
    beside += ("7 cm behind", "{} behind and {} right of", "{} ahead of and {} right of")
    slots = {block: at.format("3.5 cm", "6 cm") for block, at in zip(BLOCKS, beside, strict=True)}
    return [step for block in scene._to_clear for step in (f"grasp {block}", f"release {slots[block]} tray")]


# What a model that reads should reply; `way_round` has no parts
RIGHT_STEPS = {
    "build_tower": lambda scene: [
        step
        for number, block in enumerate(scene.blocks[: scene.height], 1)
        for step in (f"grasp {block}", f"release {number} white plate")
    ],
    "press_in_order": lambda scene: [f"reach {color} button" for color in scene.asked],
    "swap_cubes": swap_steps,
    "place_beside": lambda scene: ["grasp red block", f"release 18 cm right of {scene.combination[1][0]}"],
    "clear_kind": clear_steps,
}


class Solver:
    """Replies with the expert's poses, as integers of the task's workspace, or with parts."""

    def __init__(self):
        self.scenes = {(scene := unseen(task)).instruction: scene for task in COMPOSITION_TASKS}
        self.client, self.task = None, ""

    def __call__(self, message):
        if message.endswith("Steps:"):
            steps = RIGHT_STEPS[self.task.split(".")[0]](unseen(self.task.split(".")[0]))
            return "\n".join(f"{number}. {step}" for number, step in enumerate(steps, 1))
        if not (query := QUERY.search(message)):
            return "none"  # asked which of the taught instructions is meant
        scene = self.scenes[query[1]]
        return str([bins(action_from_move(move), self.workspace) for move in scene.expert()])

    @property
    def workspace(self):
        """As it follows from the demonstrations."""
        box = self.client.get(f"/tasks/{self.task}")["workspace"]
        return Workspace(box["min"], box["max"])


def bins(action, workspace):
    return list(discretize_actions([action], workspace)[0].bins)


# Every second one, the others by `pytest -m long`.
SOME_OR_LONG = [
    pytest.param(name, marks=[pytest.mark.long] if k % 2 else []) for k, name in enumerate(COMPOSITION_TASKS)
]


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    """Its LLM, and what that was asked."""
    solver = Solver()
    with copying_llm(solver) as (llm, asked):
        environment = {"ROBOPROMPT_DEFAULT_MODEL": MODEL, "ROBOPROMPT_COMPATIBLE_BASE_URL": llm}
        with running_server(tmp_path_factory.mktemp("data"), environment) as url, RoboPromptClient(url) as client:
            solver.client = client
            yield solver, asked


def run(solver, folder, task, methods, demonstrations):
    plan = Plan((task,), methods, 1, demonstrations, "roboprompt eval")
    with Ledger(folder / "results.jsonl") as ledger:
        session = PlanRun(plan, ledger, solver.client, InlineExecutor(), Progress(disable=True), shared=True)
        solver.task = f"{task}{suffix_of(methods[0], methods)}.eval-{session._session}"
        session()
        (result,) = evaluation_of(plan, ledger).tasks
    assert not result.crashes
    return result


def assert_shown_as_recorded(prompt, taught, workspace):
    """Each demonstration has the expert's poses, up to a bin, and none is left out."""
    rows = [np.array(json.loads(text)) for text in re.findall(r">(\[\[.*?\]\])", prompt)]
    poses = [item.recorded.expert_actions for item in taught]
    assert [len(each) for each in rows] == [len(each) for each in poses]
    for shown, actions in zip(rows, poses, strict=True):
        expected = np.array([bins(action, workspace) for action in actions])
        np.testing.assert_allclose(shown[:, :3], expected[:, :3], atol=1)
        np.testing.assert_array_equal(shown[:, -1], expected[:, -1])


@pytest.mark.parametrize("demonstrations", [1, pytest.param(10, marks=pytest.mark.long)])
@pytest.mark.parametrize("task", SOME_OR_LONG)
def test_the_right_answer_succeeds_where_it_is_allowed(service, lessons, tmp_path, task, demonstrations):
    solver, asked = service
    (method,) = chosen(SWEEP.with_models([MODEL]), [MODEL], [])
    result = run(solver, tmp_path, task, (method, BY_ITSELF), demonstrations)
    allowed, by_itself = result.trials
    assert allowed.succeeded, allowed.failure
    assert by_itself.execution is None
    assert by_itself.refused == (task in REFUSED)
    prompt = allowed.answer["prompt"]
    assert "Franka" in prompt["system"]
    assert prompt["user"] in [body["messages"][-1]["content"] for _, body in asked]
    query = prompt["user"][prompt["user"].rindex("{") :]
    assert all(f"'{name}': [" in query for name in COMPOSITION_TASKS[task].object_names)
    assert_shown_as_recorded(prompt["user"], lessons[0].taught, solver.workspace)


@pytest.mark.parametrize(
    "task", [name if name == "swap_cubes" else pytest.param(name, marks=pytest.mark.long) for name in RIGHT_STEPS]
)
def test_the_right_parts_succeed_and_have_a_danger(service, tmp_path, task):
    solver, _ = service
    (method,) = chosen(SWEEP.with_models([MODEL]), ["parts"], [])
    (trial,) = run(solver, tmp_path, task, (method,), 10).trials
    assert trial.succeeded, trial.failure
    assert "danger" in {finding["severity"] for finding in trial.answer["findings"]}


def test_models_are_asked_alike_and_the_yardsticks_have_no_other_rules():
    *models, by_itself, copy, regression, parts, replay = SWEEP.with_models([MODEL])
    assert [method.options["model"] for method in models] == [EMBEDDED, MODEL]
    assert all(method.options == {**OPEN.options, "model": method.options["model"]} for method in models)
    assert all(method.settings == OPEN.settings for method in (*models, copy, regression, parts))
    assert by_itself == Method("default", {"timeout_s": 600.0, "model": MODEL})
    assert all(method.options["unfamiliar"] == "allow" for method in (copy, regression, parts))
    assert chosen(SWEEP.with_models([]), ["nearest", "replay"], []) == (copy, replay)
