"""Who is let in, over a real server on loopback."""

import os
import time
from urllib.parse import urlsplit

import httpx
import pytest
from typer.testing import CliRunner

from app.api.access_rules import COOKIE
from app.cli import application
from app.services.api_keys import SCOPES, create_key
from app.store.store import Store
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from tests.e2e.processes import killable_server
from tests.episodes import metadata, upload

PLACE_M = (0.1, 0.1, 0.78)
QUESTION = metadata("pick", {"cube": PLACE_M}, model="regression", dry_run=True)
BROWSER = {"accept": "text/html,application/xhtml+xml"}


def keys(*words, data):
    done = CliRunner().invoke(application, ["keys", *words, "--data", str(data)])
    return done.exit_code, done.stdout.strip(), done.stderr


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return tmp_path_factory.mktemp("guarded")


@pytest.fixture(scope="module")
def tokens(data):
    """A key for each scope, and one for all that a robot does."""
    store = Store.open(data)
    made = {scope: create_key(store, f"only-{scope}", [scope]) for scope in SCOPES}
    made["robot"] = create_key(store, "robot", ["upload", "predict"])
    store.close()
    return made


@pytest.fixture(scope="module")
def address(data, tokens):
    """A service that listens beyond this machine: keys are required without a word about it."""
    environment = {"ROBOPROMPT_RATE_LIMIT_PER_S": "0", "ROBOPROMPT_DEFAULT_MODEL": "regression"}
    with killable_server(data, environment, "--host", "0.0.0.0") as (_, url):
        with httpx.Client(base_url=url, headers=bearer(tokens["admin"])) as admin:
            assert upload(admin, "pick", PLACE_M).status_code == 201
        yield url


@pytest.fixture(scope="module")
def http(address):
    with httpx.Client(base_url=address) as client:
        yield client


def bearer(token):
    return {"authorization": f"Bearer {token}"}


def log_in(address, token):
    """What the cookie of a browser holds that has logged in."""
    return httpx.post(f"{address}/ui/login", data={"key": token}).cookies[COOKIE]


REQUESTS = {
    "read": [("GET", path) for path in ("/episodes", "/tasks", "/models", "/metrics", "/docs", "/openapi.json")],
    "upload": [
        ("POST", "/episodes"),
        ("POST", "/tasks/none/object_models/learn"),
        ("POST", "/tasks/none/labels/learn"),
    ],
    "predict": [("POST", "/predict"), ("POST", "/poses"), ("POST", "/predictions/none/outcome")],
    "admin": [
        ("PUT", "/tasks/other"),
        *(("DELETE", f"/{items}/none") for items in ("episodes", "tasks", "predictions")),
        ("POST", "/nothing"),
    ],
}
EACH = [(scope, *request) for scope, requests in REQUESTS.items() for request in requests]


@pytest.mark.parametrize(("scope", "method", "path"), EACH)
def test_each_request_needs_its_scope(http, tokens, scope, method, path):
    nobody = http.request(method, path)
    assert (nobody.status_code, nobody.headers["www-authenticate"]) == (401, 'Bearer realm="roboprompt"')
    assert nobody.headers["content-type"] == "application/problem+json"
    assert nobody.json()["type"] == "/problems/unauthenticated"
    for other in set(SCOPES) - {scope, "admin"}:
        refused = http.request(method, path, headers=bearer(tokens[other]))
        assert refused.status_code == 403, (other, refused.text)
        assert f'error="insufficient_scope", scope="{scope}"' in refused.headers["www-authenticate"]
        assert f"this needs {scope}" in refused.json()["detail"]
    for let_in in (scope, "admin"):
        assert http.request(method, path, headers=bearer(tokens[let_in])).status_code not in (401, 403)


def test_a_robots_key_does_what_a_robot_does(address, tokens):
    with RoboPromptClient(address, api_key=tokens["robot"]) as client:
        assert client.motion_limits("pick").workspace is not None
        with pytest.raises(ServiceProblemError, match="needs admin"):
            client.configure_task("pick", num_demonstrations=3)
    asked = {**QUESTION, "model": "nearest", "dry_run": False}
    assert httpx.post(f"{address}/predict", json=asked, headers=bearer(tokens["robot"])).status_code == 200


def test_the_client_takes_its_key_from_the_environment(address, tokens, monkeypatch):
    monkeypatch.setenv("ROBOPROMPT_API_KEY", tokens["read"])
    with RoboPromptClient(address) as client:
        assert client.get("/episodes")["episodes"]
    with RoboPromptClient(address, api_key="") as client, pytest.raises(ServiceProblemError, match="there is no key"):
        client.get("/episodes")


def test_health_is_open(http):
    assert http.get("/healthz").status_code == 200
    assert http.get("/readyz").status_code in (200, 503)


@pytest.mark.parametrize(
    "spoilt",
    [
        lambda token: token[:-1],
        lambda token: token + "A",
        lambda token: token.rpartition("_")[0] + "_",
        lambda token: token[:15],
        lambda token: "rp_000000000000_" + token[16:],
        lambda token: "_",
        lambda token: "x" * 5000,
    ],
)  # fmt: skip
def test_invalid_keys_are_refused(http, tokens, spoilt):
    answer = http.get("/episodes", headers=bearer(spoilt(tokens["admin"])))
    assert answer.status_code == 401
    assert tokens["admin"] not in answer.text


def test_the_three_carriers(http, address, tokens):
    token = tokens["read"]
    for headers in (bearer(token), {"authorization": f"bearer  {token}"}, {"x-api-key": token}):
        assert http.get("/episodes", headers=headers).status_code == 200
    session = log_in(address, token)
    assert http.get("/episodes", headers={"cookie": f"other=1; {COOKIE}={session}"}).status_code == 200
    assert http.get("/episodes", headers={"cookie": f"{COOKIE}={token}"}).status_code == 401
    assert http.get("/episodes", headers={"cookie": f'{COOKIE}="'}).status_code == 401
    assert http.get("/episodes", params={"key": token, "api_key": token}).status_code == 401


def test_revocation_and_the_command_line(http, data):
    code, token, _ = keys("add", "short lived", "--scope", "read", "--scope", "upload", data=data)
    assert (code, token[:3], len(token)) == (0, "rp_", 59)
    deadline = time.monotonic() + 7
    while (status := http.get("/episodes", headers=bearer(token)).status_code) == 401 and time.monotonic() < deadline:
        time.sleep(0.2)
    assert status == 200
    _, listed, _ = keys("list", data=data)
    key_id = token.split("_")[1]
    (line,) = [line for line in listed.splitlines() if key_id in line]
    assert "short lived  read,upload  all tasks" in line
    assert token not in listed
    assert keys("revoke", key_id, data=data)[0] == 0
    time.sleep(5.1)
    assert http.get("/episodes", headers=bearer(token)).status_code == 401
    assert "revoked" in next(line for line in keys("list", data=data)[1].splitlines() if key_id in line)
    assert keys("revoke", "nobody", data=data)[::2] == (1, "there is no API key 'nobody'\n")
    assert "read, upload, predict, admin" in keys("add", "x", "--scope", "everything", data=data)[2]


@pytest.mark.parametrize("origin", ["https://evil.example", "null", "http://127.0.0.1:1"])
def test_other_websites_change_nothing(http, address, tokens, origin):
    for headers in (bearer(tokens["admin"]), {"cookie": f"{COOKIE}={log_in(address, tokens['admin'])}"}):
        answer = http.put("/tasks/other", json={}, headers={**headers, "origin": origin})
        assert answer.status_code == 403
        assert "other websites" in answer.json()["detail"]
    assert http.get("/tasks/other", headers=bearer(tokens["read"])).status_code == 404


def test_a_cookie_changes_nothing_without_an_origin(http, address, tokens):
    cookie = {"cookie": f"{COOKIE}={log_in(address, tokens['admin'])}"}
    assert http.put("/tasks/by_cookie", json={}, headers=cookie).status_code == 403
    assert http.put("/tasks/by_cookie", json={}, headers={**cookie, "origin": address}).status_code == 200


def test_the_log_says_who_changed_what(http, data, tokens):
    http.put("/tasks/logged", json={}, headers=bearer(tokens["admin"]))
    http.put("/tasks/logged", json={}, headers=bearer(tokens["read"]))
    http.get("/tasks/logged", headers=bearer(tokens["admin"]))
    lines = [line for line in (data / "server.log").read_text().splitlines() if "path=/tasks/logged" in line]
    (line,) = lines
    key_id = tokens["admin"].split("_")[1]
    said = f"roboprompt.changes key=only-admin ({key_id}) method=PUT path=/tasks/logged status=200 made=-"
    assert line.endswith(said)


def test_no_cors(http, tokens):
    asked = {"origin": "https://evil.example", "access-control-request-method": "GET", **bearer(tokens["admin"])}
    for answer in (http.options("/episodes", headers=asked), http.get("/episodes", headers=asked)):
        assert not [name for name in answer.headers if name.startswith("access-control-")]


def test_a_browser_logs_in(address, tokens):
    with httpx.Client(base_url=address, headers=BROWSER) as browser:
        sent_on = browser.get("/docs")
        assert (sent_on.status_code, sent_on.headers["location"]) == (303, "/ui/login?next=/docs")
        page = browser.get(sent_on.headers["location"])
        assert page.status_code == 200
        assert "script" not in page.text
        wrong = browser.post("/ui/login?next=/docs", data={"key": "rp_wrong_key"})
        assert (wrong.status_code, "set-cookie" in wrong.headers) == (401, False)
        inside = browser.post("/ui/login?next=/docs", data={"key": tokens["read"]})
        assert (inside.status_code, inside.headers["location"]) == (303, "/docs")
        cookie = inside.headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie
        assert browser.get("/docs").status_code == 200
        browser.post("/ui/logout", headers={"origin": address})
        assert browser.get("/docs").status_code == 303


@pytest.mark.parametrize("place", ["https://evil.example", "//evil.example", "/\\evil.example", "javascript:alert(1)"])
def test_a_login_redirects_to_pages_of_the_service_only(address, tokens, place):
    answer = httpx.post(f"{address}/ui/login", params={"next": place}, data={"key": tokens["read"]})
    assert answer.headers["location"] == "/ui"


def test_many_logins_do_not_fill_the_memory(http):
    def endless():
        for _ in range(20):
            yield b"key=" + b"x" * 1000

    form = {"content-type": "application/x-www-form-urlencoded"}
    assert http.post("/ui/login", content=b"key=" + b"x" * 20_000, headers=form).status_code == 413
    assert http.post("/ui/login", content=endless(), headers=form).status_code in (400, 413)  # as FastAPI reads forms


def test_security_headers_for_browsers(http, tokens):
    for path in ("/healthz", "/docs", "/episodes", "/ui/login", "/nowhere"):
        headers = http.get(path, headers=bearer(tokens["read"])).headers
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"]
        assert "frame-ancestors 'none'" in headers["content-security-policy"], path
        assert "default-src 'none'" in headers["content-security-policy"], path


def test_a_query_that_is_too_long(http, tokens):
    answer = http.get("/episodes", params={"task": "x" * 3000}, headers=bearer(tokens["read"]))
    assert (answer.status_code, answer.json()["type"]) == (414, "/problems/address-too-long")


def test_too_many_requests(tmp_path):
    environment = {"ROBOPROMPT_RATE_LIMIT_PER_S": "5", "ROBOPROMPT_RATE_LIMIT_BURST": "3", "ROBOPROMPT_AUTH": "on"}
    store = Store.open(tmp_path)
    one, other = (create_key(store, name, ["read"]) for name in ("one", "other"))
    store.close()
    with killable_server(tmp_path, environment) as (_, url), httpx.Client(base_url=url) as http:
        statuses = [http.get("/models", headers=bearer(one)).status_code for _ in range(12)]
        assert statuses[:3] == [200] * 3
        assert 429 in statuses
        refused = http.get("/models", headers=bearer(one))
        while refused.status_code == 200:
            refused = http.get("/models", headers=bearer(one))
        assert (refused.headers["retry-after"], refused.json()["type"]) == ("1", "/problems/too-many-requests")
        assert http.get("/models", headers=bearer(other)).status_code == 200
        assert all(http.get("/healthz").status_code == 200 for _ in range(12))
        guesses = [http.get("/models", headers=bearer(f"rp_guess_{k}")).status_code for k in range(12)]
        assert set(guesses) == {401, 429}
        time.sleep(1)
        assert http.get("/models", headers=bearer(one)).status_code == 200


@pytest.mark.parametrize(
    ("environment", "options", "status"),
    [
        ({}, [], 200),
        ({"ROBOPROMPT_AUTH": "on"}, [], 401),
        ({}, ["--host", "0.0.0.0", "--no-auth"], 200),
        ({"ROBOPROMPT_AUTH": "off"}, ["--host", "0.0.0.0"], 200),
    ],
)
def test_when_keys_are_required(tmp_path, environment, options, status):
    with killable_server(tmp_path, environment, *options) as (_, url):
        assert httpx.get(f"{url}/models").status_code == status


def test_without_keys_only_this_machine_may_ask(url):
    """A website whose name was bent to 127.0.0.1 names itself as the host."""
    port = urlsplit(url).port
    for host, status in {"evil.example": 403, f"evil.example:{port}": 403, f"localhost:{port}": 200}.items():
        assert httpx.get(f"{url}/models", headers={"host": host}).status_code == status
    answer = httpx.post(f"{url}/predict", json={}, headers={"origin": "https://evil.example"})
    assert answer.status_code == 403
    assert os.environ.get("ROBOPROMPT_AUTH") is None
