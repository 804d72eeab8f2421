"""The LLM has read a task's prompt before a robot asks."""

import time

import httpx
import pytest

from tests.e2e.processes import running_server
from tests.episodes import metadata, upload


@pytest.fixture(scope="module")
def http(tmp_path_factory):
    with (
        running_server(tmp_path_factory.mktemp("warm"), {"ROBOPROMPT_WARM_UP": "true"}) as url,
        httpx.Client(base_url=url, timeout=120) as client,
    ):
        for number in range(4):
            assert upload(client, "pick", (0.1 + number / 20, 0.1, 0.78)).status_code == 201
        yield client


def test_a_changed_prefix_is_read_ahead_before_the_next_prediction(http):
    """Reading the new prompt takes about a second; a busy machine needs longer."""
    for wait_s in (3.0, 10.0, 40.0):
        http.put("/tasks/pick", json={"system_prompt": f"Wait for {wait_s} s."}).raise_for_status()
        time.sleep(wait_s)
        usage = http.post("/predict", json=metadata("pick", {"cube": (0.21, 0.05, 0.78)})).json()["usage"]
        if warmed := usage["cached_tokens"] > 0.9 * usage["prompt_tokens"]:
            break
    assert warmed, usage
