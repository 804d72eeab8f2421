"""What a key may see and do: its tasks, its time, its own predictions, its own answers to repeated requests."""

import json
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

from app.store import api_keys
from app.store.store import Store
from tests.attack.tenants import Tenants, question, running_tenants, taught, with_pictures
from tests.e2e.processes import slow_llm

STREAM = {"accept": "text/event-stream"}


def ids_in(answer, name):
    return {item.get("id", item.get("name")) for item in answer.json()[name]}


def done_of(answer):
    """The last document of a stream."""
    return json.loads(answer.text.strip().rpartition("data: ")[2])


@pytest.mark.parametrize("task", ["push", "no_such_task"])
def test_another_task_is_refused_by_name(tenants: Tenants, task):
    answer = tenants.clients["pick robot"].post("/predict", json=question(task))
    assert (answer.status_code, answer.headers["content-type"]) == (403, "application/problem+json")
    assert f"the key is not for the task '{task}', only for 'pick'" in answer.json()["detail"]
    (error,) = answer.json()["errors"]
    assert (error["field"], error["valid"]) == ("task", "pick")


def test_an_upload_to_another_task_stores_nothing(tenants: Tenants):
    for task in ("push", "brand_new"):
        assert taught(tenants.clients["pick lab"], task).status_code == 403
    assert ids_in(tenants.clients["admin"].get("/tasks"), "tasks") == {"pick", "push"}
    assert len(tenants.clients["admin"].get("/episodes", params={"task": "push"}).json()["episodes"]) == 1


def test_an_expired_key_is_refused_with_the_reason(tenants: Tenants):
    answer = tenants.clients["expired"].get("/episodes")
    assert (answer.status_code, answer.json()["type"]) == (401, "/problems/unauthenticated")
    assert "the key 'expired' expired at " in answer.json()["detail"]
    key_id = tenants.tokens["expired"].split("_")[1]
    guessed = httpx.get(f"{tenants.url}/episodes", headers={"x-api-key": f"rp_{key_id}_guess"})
    assert (guessed.status_code, "expired" in guessed.text) == (401, False)
    page = httpx.post(f"{tenants.url}/ui/login", data={"key": tenants.tokens["expired"]})
    assert (page.status_code, "expired" in page.text, "set-cookie" in page.headers) == (401, True, False)


def test_the_last_use_is_kept(tenants: Tenants):
    tenants.clients["robot"].get("/predictions")
    store = Store.open(tenants.data)
    with store.read() as connection:
        used = {key.name: key.last_used_at for key in api_keys.list_all(connection)}
    store.close()
    assert used["robot"] is not None
    assert used["revoked"] is None


def test_a_prediction_is_its_keys_own(tenants: Tenants):
    robot, ids = tenants.clients["robot"], tenants.ids
    assert ids_in(robot.get("/predictions"), "predictions") == {ids["by robot"]}
    own = robot.get(f"/predictions/{ids['by robot']}").json()
    assert own["key_id"] == tenants.tokens["robot"].split("_")[1]
    assert robot.get(f"/predictions/{own['id']}/images/front/overlay").status_code == 200
    assert robot.post(f"/predictions/{own['id']}/outcome", json={"success": True}).status_code == 200


def test_a_key_that_reads_everything_records_outcomes_of_its_own_predictions_only(tenants: Tenants):
    lab, ids = tenants.clients["lab"], tenants.ids
    assert lab.get(f"/predictions/{ids['by rival']}").status_code == 200
    refused = lab.post(f"/predictions/{ids['by rival']}/outcome", json={"success": False})
    assert (refused.status_code, "another key asked" in refused.json()["detail"]) == (403, True)
    assert lab.post(f"/predictions/{ids['by lab']}/outcome", json={"success": True}).status_code == 200
    admin = tenants.clients["admin"]
    assert admin.post(f"/predictions/{ids['by lab']}/outcome", json={"success": True}).status_code == 200


def test_no_demonstrations_without_the_scope_read(tenants: Tenants):
    shown = tenants.clients["lab"].post("/predict", json=question(dry_run=True)).json()["prompt"]["user"]
    taught_line = shown.split(">")[1]
    robot = tenants.clients["robot"]
    refused = robot.post("/predict", json=question(dry_run=True))
    assert (refused.status_code, taught_line in refused.text) == (403, False)
    assert "scope read" in refused.json()["detail"]
    answer = robot.post("/predict", json=question()).json()
    stored = robot.get(f"/predictions/{answer['id']}").json()
    streamed = done_of(robot.post("/predict", json=question(), headers=STREAM))
    for document in (answer, stored, streamed):
        assert document["prompt"] is None
    assert tenants.clients["lab"].post("/predict", json=question()).json()["prompt"]["user"] == shown


@pytest.mark.parametrize("headers", [{}, STREAM], ids=["whole", "streamed"])
def test_another_key_gets_its_own_answer(tenants: Tenants, headers):
    sent = {**headers, "idempotency-key": f"shared by chance {len(headers)}"}

    def ask(name, **more):
        answer = tenants.clients[name].post("/predict", json=question(**more), headers=sent)
        return done_of(answer) if headers and answer.status_code == 200 else answer.json()

    first, other = ask("robot"), ask("rival")
    assert first["id"] != other["id"]
    assert (ask("robot")["id"], ask("rival")["id"]) == (first["id"], other["id"])
    assert ask("lab", max_actions=20)["prompt"] is not None  # other content is no conflict with another key's
    assert ask("robot", max_actions=20)["status"] == 409
    assert tenants.clients["teacher"].get(f"/uploads/{sent['idempotency-key']}").status_code == 404


def test_uploads_are_answered_by_key(tenants: Tenants):
    sent = {"idempotency-key": "dataset 1"}
    documents = [taught(tenants.clients[name], "pick", sent).json() for name in ("teacher", "pick lab")]
    assert documents[0]["id"] != documents[1]["id"]
    for name, document in zip(("teacher", "pick lab"), documents, strict=True):
        assert tenants.clients[name].get("/uploads/dataset 1").json() == {"episode_id": document["id"]}
    assert tenants.clients["reader"].get("/uploads/dataset 1").status_code == 404


def test_an_episode_carries_out_a_prediction_of_its_own_key(tenants: Tenants):
    refused = taught(tenants.clients["teacher"], "pick", prediction_id=tenants.ids["by rival"])
    assert (refused.status_code, refused.json()["errors"][0]["field"]) == (422, "prediction_id")
    own = tenants.clients["teacher"].post("/predict", files=with_pictures(question())).json()["id"]
    assert taught(tenants.clients["teacher"], "pick", prediction_id=own).status_code == 201


REPLY = "[[50, 50, 20, 0, 36, 36, 1], [50, 50, 22, 0, 36, 36, 1], [50, 50, 24, 0, 36, 36, 0]]"
EIGHT = 8


@pytest.fixture(scope="module")
def slow(tmp_path_factory):
    """A service whose LLM takes its time, and takes eight requests at once and no more."""
    places = {"ROBOPROMPT_LLM_CONCURRENT_REQUESTS": str(EIGHT), "ROBOPROMPT_LLM_QUEUED_REQUESTS": "0"}
    with slow_llm(REPLY, 0.4) as llm, running_tenants(tmp_path_factory.mktemp("slow"), {**llm, **places}) as running:
        yield running


def eight_streams(slow, headers):
    asked = {**question(), "model": "openai_compatible/slow", "unsupported": "allow", "representation": "absolute"}

    def ask(_):
        return slow.clients["robot"].post("/predict", json=asked, headers={**STREAM, **headers})

    with ThreadPoolExecutor(EIGHT + 1) as pool:
        return list(pool.map(ask, range(EIGHT + 1)))


def test_each_stream_of_a_key_counts_against_the_limits(slow: Tenants):
    statuses = sorted(answer.status_code for answer in eight_streams(slow, {}))
    assert statuses == [200] * EIGHT + [503]


def test_streams_with_one_idempotency_key_are_one_prediction(slow: Tenants):
    before = ids_in(slow.clients["robot"].get("/predictions"), "predictions")
    answers = eight_streams(slow, {"idempotency-key": "once"})
    made = ids_in(slow.clients["robot"].get("/predictions"), "predictions") - before
    assert {answer.status_code for answer in answers} == {200}
    assert {done_of(answer)["id"] for answer in answers} == made
    assert len(made) == 1
