"""A real service in its own process that attacks are tried on; `ROBOPROMPT_ATTACK=full` tries larger ones."""

import os
from dataclasses import dataclass

import httpx
import pytest

from tests.e2e.processes import killable_server
from tests.episodes import upload

FULL = os.environ.get("ROBOPROMPT_ATTACK") == "full"
ENVIRONMENT = {
    "ROBOPROMPT_DEFAULT_MODEL": "nearest",
    # nobody listens there, and no test asks it for a reply
    "ROBOPROMPT_COMPATIBLE_BASE_URL": "http://127.0.0.1:9/v1",
}


@dataclass(frozen=True)
class Service:
    process_id: int
    url: str


@pytest.fixture(scope="session")
def service(tmp_path_factory):
    with killable_server(tmp_path_factory.mktemp("attacked"), ENVIRONMENT) as (process, url):
        yield Service(process.pid, url)


@pytest.fixture(scope="session")
def http(service):
    """With one demonstration of the task `pick`."""
    with httpx.Client(base_url=service.url, timeout=120) as client:
        assert upload(client, "pick", (0.1, 0.1, 0.78)).status_code == 201
        yield client
