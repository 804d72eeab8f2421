"""Who is let in, over a real server on loopback."""

import os
import re
import time
from urllib.parse import urlsplit

import httpx
import pytest
from typer.testing import CliRunner

from app.api.access import BURST
from app.cli import application
from app.services.api_keys import SCOPES, create_key
from app.store.store import Store
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from tests.e2e.processes import killable_server
from tests.episodes import metadata, upload

PLACE_M = (0.1, 0.1, 0.78)
CHALLENGES = ['Basic realm="RoboPrompt", charset="UTF-8"', 'Bearer realm="RoboPrompt"']
SLOW = {"ROBOPROMPT_AUTH": "on", "ROBOPROMPT_RATE_LIMIT_PER_S": "0.01"}
TRUSTED = {"ROBOPROMPT_TRUSTED_PROXIES": '["127.0.0.1", "10.1.0.0/16"]'}


def keys(*words, data):
    done = CliRunner().invoke(application, ["keys", *words, "--data", str(data)])
    return done.exit_code, done.stdout.strip(), done.stderr


def made_keys(data, scopes):
    store = Store.open(data)
    made = {scope: create_key(store, f"only-{scope}", scope) for scope in scopes}
    store.close()
    return made


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return tmp_path_factory.mktemp("guarded")


@pytest.fixture(scope="module")
def tokens(data):
    """A key for each scope."""
    return made_keys(data, SCOPES)


@pytest.fixture(scope="module")
def address(data, tokens):
    """A service that listens beyond this machine: keys are required without a word about it."""
    environment = {"ROBOPROMPT_RATE_LIMIT_PER_S": "0", "ROBOPROMPT_DEFAULT_MODEL": "regression"}
    with killable_server(data, environment, "--host", "0.0.0.0") as (_, url):
        with httpx.Client(base_url=url, headers=bearer(tokens["teach"])) as teacher:
            assert upload(teacher, "pick", PLACE_M).status_code == 201
        yield url


@pytest.fixture(scope="module")
def http(address):
    with httpx.Client(base_url=address) as client:
        yield client


def bearer(token):
    return {"authorization": f"Bearer {token}"}


REQUESTS = {
    "read": [
        ("GET", path)
        for path in ("/episodes", "/tasks", "/models", "/metrics", "/docs", "/openapi.json", "/ui/tasks", "/tasks/pick")
    ],
    "predict": [
        ("POST", "/predict"),
        ("POST", "/plans"),
        ("POST", "/poses"),
        ("POST", "/predictions/none/outcome"),
        ("GET", "/tasks/pick/check"),
    ],
    "teach": [
        ("POST", "/episodes"),
        ("PATCH", "/episodes/none"),
        ("PUT", "/tasks/other"),
        ("POST", "/tasks/none/object_models/learn"),
        ("POST", "/tasks/none/labels/learn"),
        ("DELETE", "/tasks/none/labels/none"),
    ],
    "admin": [
        *(("DELETE", f"/{items}/none") for items in ("episodes", "tasks", "predictions")),
        ("POST", "/nothing"),
    ],
}
EACH = [(scope, *request) for scope, requests in REQUESTS.items() for request in requests]


@pytest.mark.parametrize(("scope", "method", "path"), EACH)
def test_each_request_needs_its_scope_or_one_that_includes_it(http, tokens, scope, method, path):
    nobody = http.request(method, path)
    assert (nobody.status_code, nobody.headers.get_list("www-authenticate")) == (401, CHALLENGES)
    assert nobody.json()["type"] == "/problems/unauthenticated"
    enough = SCOPES.index(scope)
    for less in SCOPES[:enough]:
        refused = http.request(method, path, headers=bearer(tokens[less]))
        assert refused.status_code == 403, (less, refused.text)
        assert f"has the scope {less}; this needs {scope}" in refused.json()["detail"]
    for let_in in SCOPES[enough:]:
        assert http.request(method, path, headers=bearer(tokens[let_in])).status_code not in (401, 403)


def test_a_robots_key_does_what_a_robot_does(address, tokens):
    with RoboPromptClient(address, api_key=tokens["predict"]) as client:
        assert client.motion_limits("pick").workspace is not None
        with pytest.raises(ServiceProblemError, match="needs teach"):
            client.configure_task("pick", num_demonstrations=3)
    asked = metadata("pick", {"cube": PLACE_M}, model="nearest")
    assert httpx.post(f"{address}/predict", json=asked, headers=bearer(tokens["predict"])).status_code == 200


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
        lambda token: "rp_000000000000_" + token[16:],
        lambda token: "_",
        lambda token: "x" * 5000,
    ],
)  # fmt: skip
def test_invalid_keys_are_refused(http, tokens, spoilt):
    for sent in ({"headers": bearer(spoilt(tokens["admin"]))}, {"auth": ("anyone", spoilt(tokens["admin"]))}):
        answer = http.get("/episodes", **sent)
        assert answer.status_code == 401
        assert tokens["admin"] not in answer.text


def test_a_key_is_a_bearer_or_the_password_of_any_user(http, tokens):
    token = tokens["read"]
    for user in ("", "ann", "Zoë"):
        assert http.get("/ui/tasks", auth=(user, token)).status_code == 200
    assert http.get("/episodes", headers={"authorization": f"bearer  {token}"}).status_code == 200
    for header in (token, f"Digest {token}", f"Basic {token}", "Basic ::", "Basic \xe9", "Basic", "Bearer", ""):
        assert http.get("/episodes", headers={"authorization": header.encode("latin-1")}).status_code == 401
    for place in ({"headers": {"x-api-key": token}}, {"params": {"key": token}}, {"cookies": {"key": token}}):
        assert httpx.get(f"{http.base_url}/episodes", **place).status_code == 401


def test_revocation_and_the_command_line(http, data):
    code, token, _ = keys("add", "short lived", "--scope", "read", data=data)
    assert (code, token[:3], len(token)) == (0, "rp_", 59)
    deadline = time.monotonic() + 7
    while (status := http.get("/episodes", headers=bearer(token)).status_code) == 401 and time.monotonic() < deadline:
        time.sleep(0.2)
    assert status == 200
    _, listed, _ = keys("list", data=data)
    key_id = token.split("_")[1]
    (line,) = [line for line in listed.splitlines() if key_id in line]
    assert "short lived  read  " in line
    assert token not in listed
    assert keys("revoke", key_id, data=data)[0] == 0
    time.sleep(5.1)
    assert http.get("/episodes", headers=bearer(token)).status_code == 401
    assert "revoked" in next(line for line in keys("list", data=data)[1].splitlines() if key_id in line)
    assert keys("revoke", "nobody", data=data)[::2] == (1, "there is no API key 'nobody'\n")
    assert "read, predict, teach, admin" in keys("add", "x", "--scope", "everything", data=data)[2]


FOREIGN = [
    {"origin": "https://evil.example"},
    {"origin": "null"},
    {"origin": "http://127.0.0.1:1"},
    {"sec-fetch-site": "cross-site"},
    {"sec-fetch-site": "same-site"},
]


@pytest.mark.parametrize("headers", FOREIGN)
def test_other_websites_change_nothing_with_the_password_that_a_browser_keeps(http, tokens, headers):
    password = ("me", tokens["admin"])
    answer = http.put("/tasks/other", json={}, headers=headers, auth=password)
    assert answer.status_code == 403
    assert "other websites" in answer.json()["detail"]
    assert http.get("/tasks", headers=headers, auth=password).status_code == 200


@pytest.mark.parametrize("headers", [{}, {"sec-fetch-site": "same-origin"}, {"sec-fetch-site": "none"}])
def test_own_pages_and_other_programs_change_things(http, address, tokens, headers):
    for more in ({}, {"origin": address}):
        answer = http.put("/tasks/own", json={}, headers={**headers, **more}, auth=("me", tokens["teach"]))
        assert answer.status_code == 200


def test_the_log_says_who_changed_what(http, data, tokens):
    http.put("/tasks/logged", json={}, headers=bearer(tokens["admin"]))
    http.put("/tasks/logged", json={}, headers=bearer(tokens["read"]))
    http.get("/tasks/logged", headers=bearer(tokens["admin"]))
    (line,) = [line for line in (data / "server.log").read_text().splitlines() if "path=/tasks/logged" in line]
    key_id = tokens["admin"].split("_")[1]
    said = f"roboprompt.changes key=only-admin ({key_id}) method=PUT path=/tasks/logged status=200 made=-"
    assert line.endswith(said)


def test_no_cors(http, tokens):
    asked = {"origin": "https://evil.example", "access-control-request-method": "GET", **bearer(tokens["admin"])}
    for answer in (http.options("/episodes", headers=asked), http.get("/episodes", headers=asked)):
        assert not [name for name in answer.headers if name.startswith("access-control-")]


def test_security_headers_for_browsers(http, tokens):
    for path in ("/healthz", "/docs", "/episodes", "/nowhere"):
        headers = http.get(path, headers=bearer(tokens["read"])).headers
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"]
        assert "frame-ancestors 'none'" in headers["content-security-policy"], path
        assert "default-src 'none'" in headers["content-security-policy"], path


def test_a_query_that_is_too_long(http, tokens):
    answer = http.get("/episodes", params={"task": "x" * 3000}, headers=bearer(tokens["read"]))
    assert (answer.status_code, answer.json()["type"]) == (414, "/problems/address-too-long")


def test_too_many_requests(tmp_path):
    environment = {"ROBOPROMPT_RATE_LIMIT_PER_S": "5", "ROBOPROMPT_AUTH": "on"}
    one, other = made_keys(tmp_path, ("read", "admin")).values()
    with killable_server(tmp_path, environment) as (_, url), httpx.Client(base_url=url) as http:
        statuses = [http.get("/models", headers=bearer(one)).status_code for _ in range(2 * BURST)]
        assert statuses[:BURST] == [200] * BURST
        assert 429 in statuses
        refused = http.get("/models", headers=bearer(one))
        while refused.status_code == 200:
            refused = http.get("/models", headers=bearer(one))
        assert (refused.headers["retry-after"], refused.json()["type"]) == ("1", "/problems/too-many-requests")
        assert http.get("/models", headers=bearer(other)).status_code == 200
        assert all(http.get("/healthz").status_code == 200 for _ in range(12))
        guesses = [http.get("/models", headers=bearer(f"rp_guess_{k}")).status_code for k in range(2 * BURST)]
        assert set(guesses) == {401, 429}
        time.sleep(1)
        assert http.get("/models", headers=bearer(one)).status_code == 200


@pytest.mark.parametrize(
    ("trusted", "forwarded", "statuses"),
    [
        ({}, "10.0.0.{}", {401, 429}),
        (TRUSTED, "10.0.0.{}", {401}),
        # whoever is behind a proxy may write what they like before what the proxy adds
        (TRUSTED, "192.0.2.{}, 10.9.9.9", {401, 429}),
        (TRUSTED, "192.0.2.{}, 10.8.8.8, 10.1.2.3", {401, 429}),
    ],
)
def test_forwarded_addresses_are_believed_from_named_proxies_alone(tmp_path, monkeypatch, trusted, forwarded, statuses):
    monkeypatch.setenv("FORWARDED_ALLOW_IPS", "*")  # which uvicorn would follow
    with killable_server(tmp_path, {**SLOW, **trusted}) as (_, url):
        sent = [{"x-forwarded-for": forwarded.format(k)} for k in range(BURST + 3)]
        assert {httpx.get(f"{url}/tasks", headers=headers).status_code for headers in sent} == statuses
    logged = set(re.findall(r"INFO: +([\d.]+):\d+ - ", (tmp_path / "server.log").read_text()))
    assert (logged == {"127.0.0.1"}) is not bool(trusted)


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


def test_strangers_learn_only_that_something_is_not_available(tmp_path):
    environment = {"ROBOPROMPT_DEFAULT_MODEL": f"embedded/{tmp_path}/secret.gguf"}
    with killable_server(tmp_path, environment) as (_, url):
        answer = httpx.get(f"{url}/readyz")
    assert (answer.status_code, answer.json()["checks"]) == (503, {"store": "ok", "model": "not available"})
    assert "secret.gguf" in (tmp_path / "server.log").read_text()


def test_without_keys_only_this_machine_may_ask(url):
    """A website whose name was bent to 127.0.0.1 names itself as the host."""
    port = urlsplit(url).port
    for host, status in {"evil.example": 403, f"evil.example:{port}": 403, f"localhost:{port}": 200}.items():
        assert httpx.get(f"{url}/models", headers={"host": host}).status_code == status
    for headers in FOREIGN:
        assert httpx.post(f"{url}/predict", json={}, headers=headers).status_code == 403
    assert os.environ.get("ROBOPROMPT_AUTH") is None
