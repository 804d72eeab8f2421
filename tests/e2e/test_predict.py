"""Upload demonstrations and predict with the real embedded LLM, over HTTP."""

import numpy as np
import pytest

from tests.e2e.conftest import SCRIPTED_REPLY
from tests.episodes import metadata, upload

POSITIONS_M = np.random.default_rng(8).uniform([0.0, -0.3, 0.77], [0.4, 0.3, 0.79], (10, 3)).round(4).tolist()
QUERY_M = (0.213, -0.117, 0.78)


@pytest.fixture(scope="module")
def task(http):
    http.put("/tasks/pick", json={"workspace": "rlbench"}).raise_for_status()
    for position_m in POSITIONS_M:
        assert upload(http, "pick", position_m).status_code == 201
    return "pick"


def ask(http, task, position_m=QUERY_M, **options):
    return http.post("/predict", json={**metadata(task, {"cube": position_m}), **options})


def test_embedded_llm_carries_the_pattern_to_a_new_place(http, task):
    answer = ask(http, task).json()
    offsets_m = [np.array(action["position"]) - QUERY_M for action in answer["actions"]]
    np.testing.assert_allclose(offsets_m, [[0, 0, 0.1], [0, 0, 0], [0, 0, 0.15]], atol=0.005)
    assert [action["gripper_open"] for action in answer["actions"]] == [True, False, False]
    assert answer["model"] == "embedded/gemma-3-270m"
    assert answer["representation"] == "object_frame"
    assert len(answer["demonstration_ids"]) == 10


def test_second_prediction_evaluates_only_the_query(http, task):
    ask(http, task)
    answer = ask(http, task, (0.31, 0.05, 0.78)).json()
    usage, query = answer["usage"], answer["prompt"]["user"].rpartition("\n")[2]
    assert usage["prompt_tokens"] - usage["cached_tokens"] <= len(query)
    assert usage["cached_tokens"] > 0.9 * usage["prompt_tokens"]


@pytest.mark.parametrize("representation", ["absolute", "object_frame"])
def test_dry_run_shows_the_prompt_and_records_nothing(http, task, representation):
    before = http.get("/predictions", params={"task": task}).json()
    answer = ask(http, task, dry_run=True, representation=representation).json()
    assert answer["id"] is None
    assert "cube" in answer["prompt"]["user"]
    assert http.get("/predictions", params={"task": task}).json() == before


def test_paper_format_in_full(http, task):
    options = {"representation": "absolute", "system_prompt": "a", "num_demonstrations": 1, "dry_run": True}
    prompt = ask(http, task, **options).json()["prompt"]
    assert prompt["system"].startswith("You are a Franka Panda robot with a parallel gripper.")
    first = [int(np.floor(value)) for value in (np.array(POSITIONS_M[0]) - [-0.3, -0.5, 0.6]) / 0.01]
    assert prompt["user"].startswith(f"{{'cube': {first}, 'pick up the cube'}}>[[")
    assert prompt["user"].endswith("{'cube': [51, 38, 17], 'pick up the cube'}>")


def test_a_reply_that_does_not_parse_is_an_error_with_the_reply(http, task):
    response = ask(http, task, model="scripted", representation="absolute")
    problem = response.json()
    assert response.status_code == 502
    assert problem["reply_text"] == SCRIPTED_REPLY
    assert "actions" not in problem
    stored = http.get(f"/predictions/{problem['prediction_id']}").json()
    assert (stored["status"], stored["actions"], stored["reply_text"]) == ("parse_error", None, SCRIPTED_REPLY)


def test_time_outside_the_llm_is_in_the_answer(http, task):
    ask(http, task, model="regression")
    timings = ask(http, task, model="regression").json()["timings_ms"]
    assert timings["outside_llm"] == pytest.approx(timings["total"] - timings["llm"])
    assert {"read", "poses", "prompt", "llm", "parse", "write"} <= set(timings)


def test_named_demonstrations_in_their_order(http, task):
    ids = [item["id"] for item in http.get("/episodes", params={"task": task, "limit": 3}).json()["episodes"]]
    answer = ask(http, task, dry_run=True, episode_ids=ids).json()
    assert answer["demonstration_ids"] == ids
