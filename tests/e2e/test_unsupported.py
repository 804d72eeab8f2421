"""Actions unlike what was demonstrated do not reach a robot unless it asks for them."""

import json

import httpx
import pytest

from tests.e2e.processes import running_server
from tests.episodes import metadata, upload

PLACES_M = [(0.0, 0.1, 0.78), (0.1, -0.2, 0.78), (0.3, 0.2, 0.78), (0.25, -0.1, 0.78)]
QUERY_M = (0.213, -0.117, 0.78)
GOOD = "[[51, 38, 27, 0, 36, 36, 1], [51, 38, 17, 0, 36, 36, 0], [51, 38, 32, 0, 36, 36, 0]]"
FAR = GOOD.replace("[51, 38, 17,", "[61, 38, 17,")


@pytest.fixture(scope="module")
def far(tmp_path_factory):
    """A service taught four picks, whose model replies with an action far from them."""
    environment = {"ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([FAR]), "ROBOPROMPT_WARM_UP": "false"}
    data = tmp_path_factory.mktemp("far")
    with running_server(data, environment) as url, httpx.Client(base_url=url, timeout=60) as http:
        http.put("/tasks/pick", json={"workspace": "rlbench"}).raise_for_status()
        for place_m in PLACES_M:
            upload(http, "pick", place_m).raise_for_status()
        yield http


def ask(http, headers=None, **options):
    fields = {"model": "scripted", "representation": "absolute", **options}
    return http.post("/predict", json={**metadata("pick", {"cube": QUERY_M}), **fields}, headers=headers)


def test_an_unsupported_action_is_refused_and_recorded(far):
    response = ask(far)
    problem = response.json()
    assert (response.status_code, problem["type"]) == (502, "/problems/unsupported")
    (error,) = problem["errors"]
    assert error["field"] == "actions[1]"
    assert error["message"].startswith("is 10.")
    assert "seen from cube" in error["valid"]
    assert "actions" not in problem
    stored = far.get(f"/predictions/{problem['prediction_id']}").json()
    assert (stored["status"], stored["actions"]) == ("unsupported", None)
    assert stored["reply_text"] == problem["reply_text"] == FAR
    (reason,) = [finding for finding in stored["findings"] if finding["severity"] == "danger"]
    assert (reason["code"], reason["where"]) == ("no-actions", "actions")
    assert "is 10." in reason["message"]


def test_a_stream_ends_before_the_unsupported_action(far):
    text = ask(far, {"accept": "text/event-stream"}).text
    events = [line.removeprefix("event: ") for line in text.splitlines() if line.startswith("event: ")]
    assert [name for name in events if name in ("action", "done", "error")] == ["action", "error"]
    assert "/problems/unsupported" in text
    (last, *_) = far.get("/predictions", params={"task": "pick"}).json()["predictions"]
    assert last["status"] == "unsupported"
    assert FAR.startswith(last["reply_text"])
