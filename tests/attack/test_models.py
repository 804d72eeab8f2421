"""Names of models that requests make up."""

import httpx
import pytest

from app.llm.registry import MAX_MODELS
from app.services.api_keys import create_key
from app.store.store import Store
from tests.attack import payloads
from tests.e2e.processes import killable_server

NUMBER = 2 * MAX_MODELS


def ask(http, model, **changes):
    return http.post("/predict", json={**payloads.QUESTION, "model": model, **changes})


@pytest.mark.parametrize("changes", [{"dry_run": True}, {"timeout_s": 1}], ids=["dry", "asked"])
def test_unknown_names_of_models_keep_no_place(http, changes):
    for number in range(NUMBER):
        status = ask(http, f"openai_compatible/{'-'.join(changes)}{number}", **changes).status_code
        assert status in ((200,) if changes.get("dry_run") else (503, 504))  # 504 on a busy machine
    assert ask(http, "nearest").status_code == 200
    for model in ("regression", "openai_compatible/another"):
        assert ask(http, model, dry_run=True).status_code == 200


def test_readiness_is_reported_without_details_to_requests_without_a_key(tmp_path):
    store = Store.open(tmp_path)
    key = create_key(store, "operator", ["read"])
    store.close()
    environment = {"ROBOPROMPT_AUTH": "on", "ROBOPROMPT_DEFAULT_MODEL": f"embedded/{tmp_path}/secret.gguf"}
    with killable_server(tmp_path, environment) as (_, url):
        stranger, wrong = httpx.get(f"{url}/readyz"), httpx.get(f"{url}/readyz", headers={"x-api-key": f"{key}x"})
        known = httpx.get(f"{url}/readyz", headers={"x-api-key": key})
    assert {stranger.status_code, wrong.status_code, known.status_code} == {503}
    assert stranger.json() == wrong.json()
    assert stranger.json()["checks"] == {"store": "ok", "model": "not available"}
    assert "secret.gguf" in known.json()["checks"]["model"]
