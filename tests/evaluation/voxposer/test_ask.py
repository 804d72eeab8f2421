"""The baseline in an evaluation: asked without the service, answered with a program, kept like any trial."""

from dataclasses import replace

import numpy as np
import pytest
from rich.progress import Progress

from app.evaluation.ledger import Ledger
from app.evaluation.plan import Plan
from app.evaluation.results import Crash, TaskEvaluation
from app.evaluation.run import Run
from app.evaluation.scores import task_result
from app.evaluation.sweeps import VOXPOSER
from app.evaluation.voxposer.ask import Models
from app.llm.llm_settings import LlmSettings
from roboprompt_client.client import RoboPromptClient
from tests.e2e.processes import running_server
from tests.evaluation.test_run import InlineExecutor

TASK = "push_button"
GO = "target = empty_affordance_map()\nset_voxels(target, detect('red button'))\nmove(target)\n"


@pytest.fixture(scope="module")
def url(tmp_path_factory):
    with running_server(tmp_path_factory.mktemp("data"), {"ROBOPROMPT_WARM_UP": "false"}) as address:
        yield address


@pytest.fixture
def ran(url, tmp_path):
    """The trials of an evaluation in which the model replies so, scene after scene, as the ledger keeps them."""

    def run(*replies, **changes):
        plan = Plan((TASK,), (replace(VOXPOSER, **changes),), len(replies), 1, "roboprompt eval")
        settings = LlmSettings(default_model="scripted", scripted_replies=replies)
        with Ledger(tmp_path / "results.jsonl") as ledger, RoboPromptClient(url) as client, Models(settings) as models:
            how = {"shared": True, "models": models}
            Run(plan, ledger, client, InlineExecutor(), Progress(disable=True), **how)()
        with Ledger(tmp_path / "results.jsonl") as ledger:
            return [plan.outcome(ledger, planned) for planned in plan.trials()]

    return run


def test_a_program_becomes_actions_that_are_carried_out(ran):
    (trial,) = ran(f"Here it is:\n```python\n{GO}```")
    (red,) = [pose for pose in trial.scene.objects if pose.name == "red button"]
    assert np.abs(trial.actions[-1].position_m - red.position_m).max() <= 0.011
    assert trial.execution.num_executed > 0
    answer = trial.answer
    assert (answer["model"], answer["representation"], answer["prompt_format"]) == ("scripted", "voxposer", "program")
    assert "shifted_along" in answer["prompt"]["system"]
    assert "empty_affordance_map" in answer["prompt"]["user"]
    assert answer["prompt"]["user"].endswith(f"# task: {trial.scene.instruction}\n")
    assert answer["prompt"]["user"].count('# objects: "red button", "yellow button"') == 1
    assert GO in answer["reply_text"]
    figures = task_result(TaskEvaluation(TASK, (trial,)), VOXPOSER).document()
    assert (figures["trials"], figures["no_actions"], figures["llm_s"] >= 0) == (1, 0, True)
    assert figures["tokens"]["completion_tokens"] > 0


@pytest.mark.parametrize(
    ("reply", "why"),
    [
        ("", "the program has no move"),
        ("[[50, 50, 20, 0, 36, 36, 1]]", "the program has no move"),
        ("while True:\n    pass\n", "line 1: While is not allowed"),
        (GO.replace("red", "pink"), "line 2: detect: there is no object 'pink button'"),
        ("target = empty_affordance_map()\nmove(target)\n", "no voxel of the affordance map is above 0"),
        ("```\nx = 1\n```\n```\nx = 1\n```", "the reply is not one program"),
        ("x = 1 # " + "word " * 3000, "the program was cut off"),
        (GO + "move(target)\n" * 40, "moves more than 40 times"),
    ],
)
def test_a_program_that_fails_is_a_failure_with_prompt_and_reply(ran, reply, why):
    (trial,) = ran(reply)
    assert why in trial.failure
    assert (trial.succeeded, trial.execution, trial.actions) == (False, None, ())
    assert reply.startswith(trial.answer["reply_text"])
    assert trial.answer["prompt"]["user"].endswith("\n")


def test_a_model_that_does_not_answer_says_nothing_of_the_method(ran):
    (crash,) = ran("", options={"model": "openai/none"})
    assert isinstance(crash, Crash)
    assert "ModelUnavailableError" in crash.message
