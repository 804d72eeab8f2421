"""Routes, scopes, tasks, others' ids, cookies and headers, combined as somebody would who wants more than is theirs."""

import json
import sqlite3

import httpx
import msgpack
import pytest

from app.api.access_rules import COOKIE
from tests.attack.tenants import Tenants, question, with_pictures

HTML = {"accept": "text/html"}
STREAM = {"accept": "text/event-stream"}
DRY = question(dry_run=True)
PLAN = {name: question()[name] for name in ("instruction", "objects")}


def packed(document):
    return {"content": msgpack.packb(document), "headers": {"content-type": "application/msgpack"}}


# who, method, path, what is sent, the statuses that are right; {words} stand for ids
ATTEMPTS = [
    # a key for predictions reads what is not its own
    ("robot", "GET", "/predictions/{by rival}", {}, {404}),
    ("robot", "GET", "/predictions/{by rival}/", {}, {307, 403, 404}),
    ("robot", "GET", "//predictions/{by rival}", {}, {403, 404}),
    ("robot", "GET", "/%70redictions/{by rival}", {}, {404}),
    ("robot", "GET", "/predictions/{by rival}/images/front/overlay", {}, {404}),
    ("robot", "GET", "/episodes/{pick episode}/images/front/overlay", {}, {403}),
    ("robot", "GET", "/episodes/{pick episode}/images/front/depth?original=true", {}, {403}),
    ("robot", "GET", "/episodes/{pick episode}/trajectory", {}, {403}),
    ("robot", "GET", "/episodes/{pick episode}/films/front", {}, {403}),
    ("robot", "GET", "/episodes/{pick episode}/films/front/0", {}, {403}),
    ("robot", "GET", "/ui/episodes/{pick episode}/films/front", {}, {403}),
    ("robot", "GET", "/episodes/{pick episode}", {}, {403}),
    ("robot", "HEAD", "/predictions/{by rival}", {}, {404}),  # answered as GET is
    ("robot", "OPTIONS", "/predictions/{by rival}", {}, {403, 405}),
    # by the pages
    ("robot", "GET", "/ui/predictions/{by rival}", {"headers": HTML}, {403}),
    ("robot", "GET", "/ui/predictions/{by rival}/result", {}, {403}),
    ("robot", "GET", "/ui/predict/scenes/{pick episode}", {}, {403}),
    ("robot", "GET", "/ui/episodes/{pick episode}/motion", {}, {403}),
    ("robot", "GET", "/ui/static/../episodes/{pick episode}", {}, {403, 404}),
    ("robot", "GET", "/ui/static/%2e%2e/predict/scenes/{pick episode}", {}, {403, 404}),
    # dry runs, in every way to send one
    ("robot", "POST", "/predict", {"json": DRY}, {403}),
    ("robot", "POST", "/predict", {"json": {**DRY, "dry_run": "true"}}, {403, 422}),
    ("robot", "POST", "/predict", {"files": with_pictures(DRY)}, {403}),
    ("robot", "POST", "/predict", packed(DRY), {403}),
    ("robot", "POST", "/predict", {"json": DRY, "headers": STREAM}, {403}),
    ("robot", "POST", "/predict", {"json": DRY, "headers": {"idempotency-key": "dry"}}, {403}),
    ("robot", "POST", "/ui/predict/prompt", {"json": question()}, {403}),
    ("pick robot", "POST", "/ui/predict/prompt", {"json": question("push")}, {403}),
    ("reader", "POST", "/plans", {"json": PLAN}, {403}),
    # outcomes of others' predictions
    ("robot", "POST", "/predictions/{by rival}/outcome", {"json": {"success": False}}, {404}),
    ("lab", "POST", "/predictions/{by rival}/outcome", {"json": {"success": False}}, {403}),
    ("robot", "DELETE", "/predictions/{by robot}", {}, {403}),
    # another task by name
    ("pick robot", "POST", "/predict", {"json": question("push")}, {403}),
    ("pick robot", "POST", "/predict", {"files": with_pictures(question("push"))}, {403}),
    ("pick robot", "POST", "/predict", packed(question("push")), {403}),
    ("pick robot", "POST", "/predict", {"json": question("pick ")}, {403, 422}),
    ("pick robot", "POST", "/predict", {"json": question(episode_ids=["{push episode}"])}, {404}),
    ("pick robot", "GET", "/tasks/push", {}, {403}),
    ("pick robot", "GET", "/tasks/push/check?model=nearest", {}, {403}),
    ("pick robot", "GET", "/predictions?task=push", {}, {403}),
    ("pick reader", "GET", "/episodes?task=push", {}, {403}),
    ("pick reader", "GET", "/tasks/push/stats", {}, {403}),
    ("pick reader", "GET", "/ui/episodes?task=push", {"headers": HTML}, {403}),
    ("pick reader", "GET", "/ui/predictions?task=push", {"headers": HTML}, {403}),
    ("pick reader", "GET", "/ui/tasks/push/check", {"headers": HTML}, {403}),
    ("pick reader", "GET", "/ui/predict?task=push", {"headers": HTML}, {403}),
    # another task by the id of what it holds
    ("pick reader", "GET", "/episodes/{push episode}", {}, {404}),
    ("pick reader", "GET", "/episodes/{push episode}/trajectory", {}, {404}),
    ("pick reader", "GET", "/episodes/{push episode}/images/front/overlay", {}, {404}),
    ("pick reader", "GET", "/episodes/{push episode}/films/front", {}, {404}),
    ("pick reader", "GET", "/episodes/{push episode}/films/front/0", {}, {404}),
    ("pick reader", "GET", "/ui/episodes/{push episode}/films/front", {}, {404}),
    ("pick reader", "GET", "/predictions/{by admin}", {}, {404}),
    ("pick reader", "GET", "/predictions/{by admin}/images/front/overlay", {}, {404}),
    ("pick reader", "GET", "/ui/episodes/{push episode}", {"headers": HTML}, {404}),
    ("pick reader", "GET", "/ui/episodes/{push episode}/motion", {}, {404}),
    ("pick reader", "GET", "/ui/predict?episode={push episode}", {"headers": HTML}, {404}),
    ("pick reader", "GET", "/ui/predict?again={by admin}", {"headers": HTML}, {404}),
    ("pick reader", "GET", "/ui/predict/scenes/{push episode}", {}, {404}),
    ("pick reader", "GET", "/ui/predictions/{by admin}", {"headers": HTML}, {404}),
    ("pick reader", "GET", "/ui/predictions/compare?id={by robot}&id={by admin}", {"headers": HTML}, {404}),
    # changes in another task, by who may change all of its own
    ("pick admin", "PUT", "/tasks/push", {"json": {"num_demonstrations": 1}}, {403}),
    ("pick admin", "PUT", "/tasks/brand_new", {"json": {}}, {403}),
    ("pick admin", "DELETE", "/tasks/push", {}, {403}),
    ("pick admin", "DELETE", "/episodes/{push episode}", {}, {404}),
    ("pick admin", "DELETE", "/predictions/{by admin}", {}, {404}),
    ("pick admin", "POST", "/tasks/push/object_models/learn", {"json": {}}, {403}),
    ("pick lab", "POST", "/predict", {"json": question("push", dry_run=True)}, {403}),
    ("pick lab", "POST", "/ui/predict/prompt", {"json": question("push")}, {403}),
    # keys that are none any more
    ("expired", "POST", "/predict", {"json": question()}, {401}),
    ("revoked", "POST", "/predict", {"json": question()}, {401}),
    # headers that some servers believe
    ("robot", "GET", "/predictions", {"headers": {"x-original-url": "/episodes", "x-rewrite-url": "/episodes"}}, {200}),
    ("robot", "POST", "/predictions/{by robot}/outcome", {"headers": {"x-http-method-override": "DELETE"}}, {422}),
    ("robot", "GET", "/episodes", {"headers": {"x-forwarded-for": "127.0.0.1", "forwarded": "for=127.0.0.1"}}, {403}),
    ("robot", "GET", "/episodes", {"headers": {"host": "localhost"}}, {403}),
    ("robot", "GET", "/episodes", {"headers": {"authorization": "Basic YWRtaW46YWRtaW4="}}, {403}),
    ("robot", "GET", "/episodes", {"headers": {"cookie": f"{COOKIE}=rps_000000000000_x"}}, {403}),
]
NAMES = [f"{who}: {method} {path}" for who, method, path, _, _ in ATTEMPTS]


def filled(value, ids):
    """`value` with ids in the place of {words}."""
    if isinstance(value, str):
        for word, id_ in ids.items():
            value = value.replace(f"{{{word}}}", id_)
        return value
    if isinstance(value, dict):
        return {name: filled(item, ids) for name, item in value.items()}
    return [filled(item, ids) for item in value] if isinstance(value, list) else value


@pytest.fixture(scope="module")
def taught_lines(tenants):
    """What only demonstrations say: a scene, and what was done in it."""
    prompts = [
        tenants.clients["admin"].post("/predict", json=question(task, dry_run=True)) for task in ("pick", "push")
    ]
    texts = [prompt.json()["prompt"]["user"] for prompt in prompts]
    return {text[: text.index(">") + 20] for text in texts}


@pytest.mark.parametrize(("who", "method", "path", "sent", "right"), ATTEMPTS, ids=NAMES)
def test_a_key_gets_what_it_may_read_and_no_more(tenants: Tenants, taught_lines, who, method, path, sent, right):
    answer = tenants.clients[who].request(method, filled(path, tenants.ids), **filled(sent, tenants.ids))
    assert answer.status_code in right, answer.text
    if "robot" in who:
        assert not [line for line in taught_lines if line in answer.text]


def state(tenants):
    """Every row that an attempt could have changed."""
    with sqlite3.connect(tenants.data / "roboprompt.db") as database:
        queries = (
            "SELECT name, settings FROM tasks ORDER BY name",
            "SELECT id, task FROM episodes ORDER BY id",
            "SELECT id, task, key_id, outcome_success FROM predictions WHERE status = 'ok' ORDER BY id",
        )
        return [database.execute(query).fetchall() for query in queries]


def test_refused_requests_change_nothing(tenants: Tenants):
    before = state(tenants)
    for who, method, path, sent, right in ATTEMPTS:
        if 200 not in right:
            tenants.clients[who].request(method, filled(path, tenants.ids), **filled(sent, tenants.ids))
    assert state(tenants) == before


@pytest.mark.parametrize(
    "path",
    ["/ui/tasks", "/ui/episodes", "/ui/predictions", "/ui/predict", "/tasks", "/episodes"],
)
def test_lists_and_pages_do_not_name_other_tasks(tenants: Tenants, path):
    answer = tenants.clients["pick reader"].get(path)
    assert answer.status_code == 200
    for hidden in ("push", tenants.ids["push episode"], tenants.ids["by admin"]):
        assert hidden not in answer.text.replace("push_button", ""), hidden


def test_words_are_read_against_the_tasks_of_the_key_alone(tenants: Tenants):
    planned = tenants.clients["pick robot"].post("/plans", json=PLAN)
    assert planned.json() == {"steps": [{"task": "pick", "instruction": PLAN["instruction"]}]}
    refused = tenants.clients["pick robot"].post("/plans", json={**PLAN, "instruction": "dance"})
    assert refused.status_code == 422
    assert "push" not in refused.text
    assert tenants.clients["pick robot"].post("/predict", json=question(None)).json()["task"] == "pick"
    both = tenants.clients["robot"].post("/predict", json=question(None))
    assert both.status_code == 422
    assert "(pick) or " in both.text


def test_pages_of_a_list_stay_within_what_is_seen(tenants: Tenants):
    robot, cursor, seen = tenants.clients["robot"], None, []
    for _ in range(20):
        answer = robot.get("/predictions", params={"limit": 1, **({"cursor": cursor} if cursor else {})}).json()
        seen += [item["key_id"] for item in answer["predictions"]]
        if (cursor := answer["next_cursor"]) is None:
            break
    assert set(seen) == {tenants.tokens["robot"].split("_")[1]}


def test_what_a_key_has_is_not_proof_for_another_way_in(tenants: Tenants):
    """A key is no cookie, a session no key; the last word of two is not the louder one's."""
    key, session = tenants.tokens["reader"], tenants.log_in("reader")

    def status(**headers):
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        return httpx.get(f"{tenants.url}/episodes", headers=named).status_code

    assert status(cookie=f"{COOKIE}={session}") == 200
    assert status(cookie=f"{COOKIE}={key}") == 401
    assert status(cookie=f"roboprompt_key={key}") == 401
    assert status(x_api_key=session) == 401
    assert status(authorization=f"Bearer {session}") == 401
    assert status(cookie=f"{COOKIE}={session[:-1]}") == 401
    assert status(cookie=f"{COOKIE}={session.replace('rps_', 'rp_', 1)}") == 401
    # a key that is sent counts, not the cookie beside it
    assert status(cookie=f"{COOKIE}={session}", authorization=f"Bearer {tenants.tokens['robot']}") == 403
    assert status(cookie=f"{COOKIE}={session}", x_api_key="junk") == 401


def test_a_cookie_beside_other_credentials_still_needs_an_origin(tenants: Tenants):
    session = {"cookie": f"{COOKIE}={tenants.log_in('admin')}"}
    for more in ({}, {"authorization": "Basic eDp5"}, {"authorization": "Digest x"}, {"x-api-key": ""}):
        answer = httpx.put(f"{tenants.url}/tasks/forged", json={}, headers={**session, **more})
        assert (answer.status_code, "other websites" in answer.text) == (403, True), more
    assert tenants.clients["admin"].get("/tasks/forged").status_code == 404


def test_problems_do_not_quote_keys(tenants: Tenants):
    for token in (tenants.tokens["expired"], tenants.tokens["robot"], tenants.log_in("reader")):
        for headers in ({"x-api-key": token}, {"cookie": f"{COOKIE}={token}"}):
            answer = httpx.get(f"{tenants.url}/tasks/{token}", headers=headers)
            secret = token.split("_", 2)[2]
            assert secret not in json.dumps(dict(answer.headers))
            assert answer.status_code == 404 or secret not in answer.text
