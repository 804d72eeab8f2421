"""Names of models that requests make up."""

import pytest

from app.llm.registry import MAX_MODELS
from tests.attack import payloads

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
