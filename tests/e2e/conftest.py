"""A real service in its own process, with the real embedded LLM, on loopback."""

import json

import httpx
import pytest

from tests.e2e.processes import running_server

SCRIPTED_REPLY = "I would rather not move today."


@pytest.fixture(scope="session")
def url(tmp_path_factory):
    environment = {
        "ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([SCRIPTED_REPLY]),
        "ROBOPROMPT_MAX_BODY_MB": "20",
    }
    with running_server(tmp_path_factory.mktemp("data"), environment) as address:
        yield address


@pytest.fixture(scope="session")
def http(url):
    with httpx.Client(base_url=url, timeout=120) as client:
        yield client
