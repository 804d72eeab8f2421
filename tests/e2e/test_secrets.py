"""Secrets that the service is given come out nowhere: not in answers, logs, prompts, metrics or files."""

import json

import httpx
import pytest

from app.services.api_keys import create_key
from app.store.store import Store
from tests.e2e.processes import answering, killable_server
from tests.episodes import metadata, upload

PLANTED = {
    "ROBOPROMPT_OPENAI_API_KEY": "sk-planted-openai-0123456789",
    "ROBOPROMPT_ANTHROPIC_API_KEY": "sk-ant-planted-0123456789",
    "ROBOPROMPT_COMPATIBLE_API_KEY": "planted-compatible-0123456789",
}
MODELS = ("openai/gpt-4o", "anthropic/claude-sonnet-4-5", "openai_compatible/any")
PLACE_M = (0.1, 0.1, 0.78)


def gossip(request, _):
    """What a provider answers whose errors repeat every header that it was sent."""
    error = {"message": f"I was sent {dict(request.headers)}", "type": "auth"}
    return 401, "application/json", json.dumps({"error": error})


@pytest.fixture(scope="module")
def provoked(tmp_path_factory):
    """Everything that a service said and wrote while it was used and abused, and the secrets that it had."""
    data = tmp_path_factory.mktemp("secrets")
    store = Store.open(data)
    token = create_key(store, "robot", "admin")
    store.close()
    answers = []
    with answering(gossip) as address:
        urls = {name.replace("API_KEY", "BASE_URL"): f"{address}/v1" for name in PLANTED}
        settings = {**PLANTED, **urls, "ROBOPROMPT_AUTH": "on", "ROBOPROMPT_RATE_LIMIT_PER_S": "0"}
        key = {"authorization": f"Bearer {token}"}
        with killable_server(data, settings) as (_, url), httpx.Client(base_url=url, headers=key, timeout=60) as http:
            assert upload(http, "pick", PLACE_M).status_code == 201
            answers += provoke(http, token)
    files = [path.read_bytes().decode(errors="replace") for path in data.rglob("*") if path.is_file()]
    return [*answers, *files], [*PLANTED.values(), token, token.split("_", 2)[2]]


def provoke(http, token):
    question = metadata("pick", {"cube": PLACE_M})
    responses = [http.post("/predict", json={**question, "model": model}) for model in MODELS]
    assert [response.status_code for response in responses] == [503] * 3, [response.text for response in responses]
    responses += [http.post("/predict", json={**question, "model": "regression", "dry_run": True})]
    responses += [http.post("/predict", content=b"{", headers={"content-type": "application/json"})]
    responses += [http.post("/predict", json={**question, "task": "\x00", "timeout_s": "soon"})]
    responses += [http.get("/episodes", params={"key": token}), http.get(f"/episodes/{token}")]
    responses += [
        http.get(path) for path in ("/predictions", "/metrics", "/models", "/readyz", "/openapi.json", "/tasks")
    ]
    responses += [http.get("/models", headers={"authorization": f"Bearer {token}x"})]
    # what the caller itself put into a path is repeated to nobody but the caller
    return [f"{r.headers}{r.text}".replace(f"/episodes/{token}", "") for r in responses if token not in str(r.url.path)]


def test_no_secret_comes_out(provoked):
    said, secrets = provoked
    for secret in secrets:
        for text in said:
            assert secret not in text, text[max(0, text.index(secret) - 200) :][:400]


def test_no_traceback_reaches_a_client(provoked):
    said, _ = provoked
    assert not [text for text in said if text.startswith("Headers(") and ("Traceback" in text or 'File "' in text)]


def test_what_was_provoked_was_said(provoked):
    """The errors came through, so that the test above looks at something."""
    said, _ = provoked
    everything = "".join(said)
    assert "I was sent" in everything or "ROBOPROMPT_OPENAI_API_KEY" in everything
    assert "/episodes?key=rp_(hidden)" in everything
