"""The whole benchmark against a real service on loopback, with a small world in Meta-World's place."""

import json
import math

import httpx
import pytest

from benchmarks.metaworld.demonstrate import DemonstrationCache
from benchmarks.metaworld.ledger import REPLAY, Ledger
from benchmarks.metaworld.plan import Plan, is_llm
from benchmarks.metaworld.scores import results, summary
from benchmarks.metaworld.service import Service, ServiceError
from benchmarks.metaworld.trials import Benchmark
from tests.benchmarks.metaworld.button_world import ButtonWorld
from tests.e2e.processes import running_server

WORKSPACE = {"min": [-0.6, 0.2, -0.1], "max": [0.6, 1.0, 0.6]}
SETTINGS = {"workspace": WORKSPACE, "keyframes": {"rule": "merged"}}
TASK = "button-press"
PLAN = Plan(demos=4, tests=3, models=("nearest", "regression"), settings=SETTINGS)


@pytest.fixture(scope="module")
def url(tmp_path_factory):
    environment = {"ROBOPROMPT_WARM_UP": "false", "ROBOPROMPT_SCRIPTED_REPLIES": json.dumps(["I would rather not."])}
    with running_server(tmp_path_factory.mktemp("data"), environment) as address:
        yield address


@pytest.fixture
def out(tmp_path):
    return tmp_path / "results.jsonl"


def run(url, out, plan=PLAN, open_world=ButtonWorld, transport=None):
    """The summary's entry for the task, and the lines that were reported."""
    lines = []
    with Ledger(out, plan.conditions()) as ledger, Service(url, transport) as service:
        Benchmark(plan, service, ledger, open_world, DemonstrationCache(None), lines.append).run([TASK])
        return summary(results(ledger, [TASK], plan.models))["tasks"][TASK], lines


def no_world(task):
    raise AssertionError(f"{task} has everything that is wanted")


def test_teach_replay_predict_and_execute(url, out):
    found, lines = run(url, out)
    everything = {"successes": 3, "trials": 3, "errors": 0, "success_rate": 1.0}
    assert found["replay"] == everything
    assert found["models"] == {"nearest": everything, "regression": everything}
    assert (found["demonstrations"], found["problems"], found["llm_seconds"]) == (4, [], None)
    assert 1 <= found["keyframes"]["min"] <= found["keyframes"]["max"] <= 4
    assert lines[0].startswith("button-press: replay 3/3, nearest 3/3, regression 3/3; ")
    with httpx.Client(base_url=url) as http:
        (task,) = [task for task in http.get("/tasks").json()["tasks"] if task["num_episodes"] == 4]
        assert task["workspace"] == {"preset": None, **WORKSPACE}
        predictions = http.get("/predictions", params={"task": task["name"]}).json()["predictions"]
    assert [prediction["outcome"]["success"] for prediction in predictions] == [True] * 6


def test_what_is_there_is_not_run_again(url, out):
    first, _ = run(url, out)
    before = out.read_text()
    again, lines = run(url, out, open_world=no_world)
    assert (again, lines, out.read_text()) == (first, [], before)


def test_more_tests_and_models_go_on_with_the_same_demonstrations(url, out):
    run(url, out, Plan(demos=4, tests=1, models=("nearest",), settings=SETTINGS))
    found, _ = run(url, out)
    records = [json.loads(line) for line in out.read_text().splitlines()]
    assert [record["kind"] for record in records].count("taught") == 1
    assert [record["kind"] for record in records].count("trial") == 9
    assert {model: score["trials"] for model, score in found["models"].items()} == {"nearest": 3, "regression": 3}


def test_a_service_that_lost_the_task_is_taught_again(url, out):
    run(url, out, Plan(demos=4, tests=1, models=("nearest",), settings=SETTINGS))
    forget(out, {**json.loads(taught_line(out)), "service_task": "gone"})
    found, _ = run(url, out)
    assert found["models"]["nearest"] == {"successes": 3, "trials": 3, "errors": 0, "success_rate": 1.0}


def test_a_service_that_finds_other_keyframes_is_not_mixed_in(url, out):
    run(url, out, Plan(demos=4, tests=1, models=("nearest",), settings=SETTINGS))
    forget(out, {**json.loads(taught_line(out)), "service_task": "gone", "keyframes": [9] * 4})
    with pytest.raises(ServiceError, match=r"keyframes where it found \[9, 9, 9, 9\] .*--out"):
        run(url, out)


def taught_line(out):
    return out.read_text().splitlines()[1]


def forget(out, taught):
    """Put another line in the place of how the task was taught."""
    conditions, _, *others = out.read_text().splitlines()
    out.write_text("\n".join([conditions, json.dumps(taught), *others]) + "\n")


def test_predictions_without_actions_are_failures_and_shown_apart(url, out):
    plan = Plan(demos=2, tests=1, llm_tests=2, models=("scripted", "scripted/any"), settings=SETTINGS)
    found, lines = run(url, out, plan)
    assert found["models"] == {
        "scripted": {"successes": 0, "trials": 1, "errors": 1, "success_rate": 0.0},
        "scripted/any": {"successes": 0, "trials": 2, "errors": 2, "success_rate": 0.0},
    }
    assert [problem[:4] for problem in found["problems"]] == ["502 ", "422 ", "422 "]
    assert found["llm_seconds"]["max"] > 0
    assert [line.partition(";")[0] for line in lines] == [
        "button-press: replay 1/1, scripted 0/1",
        "button-press: scripted/any 0/2",
    ]


def test_llms_are_those_that_have_a_provider():
    assert [is_llm(model) for model in ("nearest", "regression", "embedded/gemma-3-270m")] == [False, False, True]


def test_demonstrations_that_fail_are_replaced(url, out):
    plan = Plan(demos=3, tests=1, models=(), settings=SETTINGS)
    with Ledger(out, plan.conditions()) as ledger, Service(url) as service:
        odd = Benchmark(plan, service, ledger, EvenSeedsOnly, DemonstrationCache(None), print)
        odd.run([TASK])
        assert list(ledger.taught(TASK).seeds.values()) == [0, 2, 4]


class EvenSeedsOnly(ButtonWorld):
    def reset(self, seed):
        self._hopeless_from = math.inf if seed % 2 == 0 else 0
        return super().reset(seed)


def test_without_demonstrations_everything_fails(url, out):
    found, _ = run(url, out, open_world=lambda task: ButtonWorld(task, hopeless_from=0))
    nothing = {"successes": 0, "trials": 3, "errors": 3, "success_rate": 0.0}
    assert found["replay"] == found["models"]["nearest"] == nothing
    assert (found["demonstrations"], found["keyframes"]) == (0, None)


def test_worlds_are_closed(url, out):
    opened = []
    run(url, out, open_world=lambda task: opened.append(ButtonWorld(task)) or opened[-1])
    assert [world.closed for world in opened] == [True]


def test_noise_moves_what_is_reported_and_not_what_is_there(url, out, tmp_path):
    plan = Plan(demos=2, tests=2, models=("nearest",), settings=SETTINGS, noise_m=0.2)
    noisy, _ = run(url, out, plan)
    exact, _ = run(url, tmp_path / "exact.jsonl", Plan(demos=2, tests=2, models=("nearest",), settings=SETTINGS))
    assert noisy["replay"] == exact["replay"]
    assert noisy["models"]["nearest"]["successes"] < exact["models"]["nearest"]["successes"] == 2
    assert [Plan(noise_m=0.2, noise_on=on).noise("demos") for on in ("demos", "tests", "both")] == [0.2, 0.0, 0.2]
    assert [Plan(noise_m=0.2, noise_on=on).noise("tests") for on in ("demos", "tests", "both")] == [0.0, 0.2, 0.2]


def test_refused_uploads_are_kept_with_the_reason(out):
    def refuse(request):
        if request.url.path == "/episodes":
            errors = [{"field": "metadata.objects", "message": "too many"}]
            return httpx.Response(422, json={"title": "Invalid input", "detail": "no", "errors": errors})
        return httpx.Response(404, json={"title": "No such task"})

    plan = Plan(demos=2, tests=1, models=("nearest",))
    found, _ = run("http://service", out, plan, transport=httpx.MockTransport(refuse))
    assert found["problems"] == [
        "422 Invalid input; no; metadata.objects: too many",
        "422 Invalid input; no; metadata.objects: too many",
        "no demonstration",
        "404 No such task",
    ]


def test_a_prediction_without_an_answer_in_time_is_an_error_and_a_lost_service_ends_the_run(out):
    def late(request):
        raise httpx.ReadTimeout("late", request=request)

    def gone(request):
        raise httpx.ConnectError("refused", request=request)

    with Service("http://service", httpx.MockTransport(late)) as service:
        assert service.predict({}).problem == "504 no answer in time"
    with pytest.raises(ServiceError, match="refused"):
        run("http://service", out, transport=httpx.MockTransport(gone))


def test_a_reply_that_is_no_json_is_a_problem(url):
    with Service(url, httpx.MockTransport(lambda _: httpx.Response(502, text="Bad Gateway"))) as service:
        assert service.predict({}).problem == "502 Bad Gateway"


def test_seeds_of_each_method():
    plan = Plan(demos=3, tests=5, llm_tests=2, first_test_seed=70)
    assert list(plan.seeds(REPLAY)) == [0, 1, 2]
    assert list(plan.seeds("nearest")) == [70, 71, 72, 73, 74]
    assert list(plan.seeds("embedded/gemma-3-270m")) == [70, 71]
