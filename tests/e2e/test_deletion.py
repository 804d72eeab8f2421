"""Tasks and predictions are deleted with all that they hold. tests/e2e/test_auth.py has who may."""

import httpx
import pytest

from tests.e2e.processes import running_server
from tests.episodes import metadata, upload

PLACE_M = (0.1, 0.1, 0.78)
QUESTION = {**metadata("pick", {"cube": PLACE_M}), "model": "nearest"}


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    settings = {"ROBOPROMPT_DEFAULT_MODEL": "nearest"}
    with running_server(tmp_path_factory.mktemp("deletion"), settings) as url, httpx.Client(base_url=url) as client:
        yield client


@pytest.fixture
def admin(service):
    """With the task `pick`, whose upload may be sent again."""
    episode = upload(httpx_with(service, {"idempotency-key": "upload"}), "pick", PLACE_M)
    assert episode.status_code == 201, episode.text
    yield service
    service.delete("/tasks/pick")


def httpx_with(http, headers):
    class Sender:
        def post(self, path, **arguments):
            return http.post(path, headers=headers, **arguments)

    return Sender()


def ask(http):
    return http.post("/predict", json=QUESTION)


def test_a_prediction(admin):
    first = ask(admin).json()["id"]
    admin.post(f"/predictions/{first}/outcome", json={"success": True})
    assert admin.get("/tasks/pick/stats").json()["successes"] == 1
    assert admin.delete(f"/predictions/{first}").status_code == 204
    assert {admin.request(method, f"/predictions/{first}").status_code for method in ("GET", "DELETE")} == {404}
    assert admin.get("/tasks/pick/stats").json()["successes"] == 0


def test_a_task_and_one_of_the_same_name_after_it(admin):
    asked = ask(admin).json()["id"]
    (episode,) = admin.get("/episodes", params={"upload_key": "upload"}).json()["episodes"]
    assert admin.get("/episodes", params={"upload_key": "other"}).json()["episodes"] == []
    admin.put("/tasks/pick", json={"num_demonstrations": 3})
    assert admin.delete("/tasks/pick").status_code == 204
    for path in ("/tasks/pick", f"/episodes/{episode['id']}", f"/predictions/{asked}"):
        assert admin.get(path).status_code == 404, path
    assert admin.delete("/tasks/pick").status_code == 404
    assert ask(admin).status_code == 404
    again = upload(httpx_with(admin, {"idempotency-key": "upload"}), "pick", PLACE_M).json()
    assert again["id"] != episode["id"]
    assert admin.get("/tasks/pick").json()["num_demonstrations"] == 10
    assert ask(admin).json()["demonstration_ids"] == [again["id"]]
