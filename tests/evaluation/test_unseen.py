"""Tasks left out one at a time: the service is taught the others only, and prompts show these."""

import pytest
from rich.progress import Progress

from app.evaluation.ledger import Ledger
from app.evaluation.methods import Method, with_noise, with_poses, with_shift
from app.evaluation.plan import Plan
from app.evaluation.run import Run
from app.evaluation.server import running_server
from app.evaluation.sweeps import COPY, REGRESSION, SWEEPS, UNSEEN, chosen
from app.evaluation.tables import markdown
from app.evaluation.teach import suffix_of, variants
from app.sim.tasks import TASKS
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import InvalidInputError
from tests.evaluation.test_run import InlineExecutor

SWEEP = SWEEPS["unseen"]
LENT = Method("lent", COPY.options, unseen=True)
FITTED = Method("fitted", REGRESSION.options, unseen=True)


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Two tasks tested, a third taught beside them; the service's episodes by task."""
    plan = Plan(("push_button", "open_drawer"), (LENT, FITTED, COPY), 1, 3, "eval", lending=("push_button_real",))
    folder = tmp_path_factory.mktemp("unseen")
    with running_server(folder / "data", {"ROBOPROMPT_WARM_UP": "false"}) as url, RoboPromptClient(url) as client:
        with Ledger(folder / "results.jsonl") as ledger:
            evaluation = Run(plan, ledger, client, InlineExecutor(), Progress(disable=True))()
        tasks = {task["name"]: task["num_episodes"] for task in client.get("/tasks")["tasks"]}
        shown = {
            (trial.task, trial.method): [client.get(f"/episodes/{id_}")["task"] for id_ in ids]
            for task in evaluation.tasks
            for trial in task.trials
            for ids in [(trial.answer or {}).get("demonstration_ids", ())]
        }
    return plan, evaluation, tasks, shown


def test_what_is_tested_has_no_episodes_and_is_shown_those_of_others(ran):
    plan, _, tasks, shown = ran
    suffix = suffix_of(LENT, plan.methods)
    assert suffix == suffix_of(FITTED, plan.methods) != ""
    assert {name: tasks[name] for name in (f"push_button{suffix}", f"open_drawer{suffix}")} == {
        f"push_button{suffix}": 0,
        f"open_drawer{suffix}": 0,
    }
    assert tasks["push_button"] == tasks["push_button_real"] == tasks["open_drawer"] == 3
    assert set(shown["push_button", "lent"]) == {"push_button_real"}, "the drawer has no word in common"
    assert set(shown["push_button", COPY.label]) == {"push_button"}


def test_a_near_relative_solves_it_and_a_stranger_does_not(ran):
    _, evaluation, _, shown = ran
    outcomes = {(trial.task, trial.method): trial for task in evaluation.tasks for trial in task.trials}
    assert outcomes["push_button", "lent"].succeeded
    assert outcomes["push_button", COPY.label].succeeded
    assert not outcomes["open_drawer", "lent"].succeeded
    assert "open_drawer" not in shown["open_drawer", "lent"]


def test_a_yardstick_without_an_answer_counts_as_a_failure(ran):
    _, evaluation, _, _ = ran
    assert all(len(task.trials) == 3 and not task.crashes for task in evaluation.tasks)
    fitted = {trial.task: trial for task in evaluation.tasks for trial in task.trials if trial.method == "fitted"}
    assert "regression found 0 of" in fitted["open_drawer"].error
    assert fitted["open_drawer"].execution is None
    assert 'demonstrations of "similar tasks"' in markdown(evaluation, SWEEP.about)


def test_every_task_lends_whichever_is_tested():
    assert SWEEP.lending == tuple(TASKS)
    plan = Plan(("push_button",), (UNSEEN,), 1, 3, "eval", lending=SWEEP.lending)
    assert set(plan.taught) == set(TASKS)
    assert [cell.task for cell in plan.trials()] == ["push_button"]


def test_results_depend_on_which_tasks_lend():
    narrow, wide = (Plan(("push_button",), (UNSEEN, COPY), 1, 3, "eval", lending=lent) for lent in ((), tuple(TASKS)))
    assert narrow.digest(UNSEEN) != wide.digest(UNSEEN)
    assert narrow.digest(COPY) == wide.digest(COPY)


def test_the_model_is_asked_as_it_is_and_beside_it_the_yardsticks():
    methods = SWEEP.with_models(["openai/gpt-4o"])
    assert methods[0].options == {"model": "openai/gpt-4o"}
    assert [method.unseen for method in methods] == [True, True, True, False]
    assert len(variants(methods)) == 2
    assert chosen(methods, ["nearest"], []) == (COPY,)


@pytest.mark.parametrize(
    "change",
    [
        lambda: with_noise([UNSEEN], 1.0, "both"),
        lambda: with_poses([UNSEEN], "vision"),
        lambda: with_shift([UNSEEN], 0.03),
    ],
)
def test_what_would_need_other_demonstrations_is_refused(change):
    with pytest.raises(InvalidInputError, match="demonstrations of other tasks"):
        change()


def test_noise_on_what_is_seen_is_no_other_lesson():
    (noisy,) = with_noise([UNSEEN], 1.0, "test")
    assert (noisy.noise, noisy.unseen) == (1.0, True)
    assert variants([noisy]).keys() == variants([UNSEEN]).keys()
