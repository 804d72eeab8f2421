"""Tasks and predictions are deleted with all that they hold, by those who may."""

import httpx
import pytest

from app.services.api_keys import create_key
from app.store.store import Store
from tests.e2e.processes import killable_server
from tests.episodes import metadata, upload

PLACE_M = (0.1, 0.1, 0.78)
QUESTION = {**metadata("pick", {"cube": PLACE_M}), "model": "nearest"}


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """A service that requires keys, and a client for each scope."""
    data = tmp_path_factory.mktemp("deletion")
    store = Store.open(data)
    tokens = {scope: create_key(store, scope, [scope]) for scope in ("read", "upload", "predict", "admin")}
    store.close()
    with killable_server(data, {"ROBOPROMPT_AUTH": "on", "ROBOPROMPT_DEFAULT_MODEL": "nearest"}) as (_, url):
        clients = {
            name: httpx.Client(base_url=url, headers={"x-api-key": token}, timeout=60) for name, token in tokens.items()
        }
        yield clients
        for client in clients.values():
            client.close()


@pytest.fixture
def admin(keys):
    """With the task `pick`, whose upload and prediction may be sent again."""
    http = keys["admin"]
    document = {"idempotency-key": "upload"}
    episode = upload(httpx_with(http, document), "pick", PLACE_M)
    assert episode.status_code == 201, episode.text
    yield http
    http.delete("/tasks/pick")


def httpx_with(http, headers):
    class Sender:
        def post(self, path, **arguments):
            return http.post(path, headers=headers, **arguments)

    return Sender()


def ask(http, key):
    return http.post("/predict", json=QUESTION, headers={"idempotency-key": key})


@pytest.mark.parametrize("scope", ["read", "upload", "predict"])
def test_other_scopes_delete_nothing(keys, admin, scope):
    asked = ask(admin, "scopes").json()["id"]
    for path in ("/tasks/pick", f"/predictions/{asked}"):
        assert keys[scope].delete(path).status_code == 403
        assert admin.get(path).status_code == 200


def test_a_prediction(admin):
    first = ask(admin, "one").json()["id"]
    assert ask(admin, "one").json()["id"] == first
    admin.post(f"/predictions/{first}/outcome", json={"success": True})
    assert admin.get("/tasks/pick/stats").json()["successes"] == 1
    assert admin.delete(f"/predictions/{first}").status_code == 204
    assert {admin.request(method, f"/predictions/{first}").status_code for method in ("GET", "DELETE")} == {404}
    assert admin.get("/tasks/pick/stats").json()["successes"] == 0
    assert ask(admin, "one").json()["id"] != first


def test_a_task_and_one_of_the_same_name_after_it(admin):
    asked = ask(admin, "two").json()["id"]
    (episode,) = admin.get("/episodes", params={"task": "pick"}).json()["episodes"]
    admin.put("/tasks/pick", json={"num_demonstrations": 3})
    assert admin.delete("/tasks/pick").status_code == 204
    for path in ("/tasks/pick", f"/episodes/{episode['id']}", f"/predictions/{asked}", "/uploads/upload"):
        assert admin.get(path).status_code == 404, path
    assert admin.delete("/tasks/pick").status_code == 404
    assert ask(admin, "two").status_code == 404
    again = upload(httpx_with(admin, {"idempotency-key": "upload"}), "pick", PLACE_M).json()
    assert again["id"] != episode["id"]
    assert admin.get("/tasks/pick").json()["num_demonstrations"] == 10
    answer = ask(admin, "two").json()
    assert answer["demonstration_ids"] == [again["id"]]
    assert answer["id"] != asked
