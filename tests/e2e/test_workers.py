"""Several uvicorn workers over one PostgreSQL and one embedded LLM."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest

from app.evaluation.server import running_server
from tests.episodes import metadata, upload


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return tmp_path_factory.mktemp("workers")


@pytest.fixture(scope="module")
def url(data, postgres):
    environment = {
        "ROBOPROMPT_DATABASE_URL": postgres.empty(),
        "ROBOPROMPT_EMBEDDED_THREADS": "1",
    }
    with running_server(data, environment, ["--workers", "2"]) as address:
        yield address


def test_uploads_of_all_workers_are_seen_by_all(url):
    with ThreadPoolExecutor(8) as pool, httpx.Client(base_url=url, timeout=120) as http:
        answers = list(pool.map(lambda k: upload(http, "pick", (0.1 + k / 100, 0.0, 0.8)), range(16)))
    assert {answer.status_code for answer in answers} == {201}
    for _ in range(10):  # each on a connection of its own: either worker may take it
        listed = httpx.get(f"{url}/episodes", params={"task": "pick"}, timeout=120).json()["episodes"]
        assert sorted(item["id"] for item in listed) == sorted(answer.json()["id"] for answer in answers)


def test_workers_share_one_llm_and_answer_when_it_died(url, data):
    def ask(number):
        document = metadata("pick", {"cube": (0.2, number / 100, 0.8)}, num_demonstrations=1)
        return httpx.post(f"{url}/predict", json=document, timeout=120).status_code

    with ThreadPoolExecutor(4) as pool:
        assert set(pool.map(ask, range(4))) == {200}
        (llama,) = llama_pids(data)
        os.kill(llama, 9)
        assert set(pool.map(ask, range(4))) == {200}
    assert llama not in llama_pids(data)


def llama_pids(data):
    """The llama.cpp processes of the process that serves `data`, and of its workers."""
    parents = {pid: parent_of(pid) for pid in pids("llama/child")}
    return [pid for pid, parent in parents.items() if str(data) in command_of(parent) + command_of(parent_of(parent))]


def pids(word):
    return [int(path.name) for path in Path("/proc").glob("[0-9]*") if word in command_of(int(path.name))]


def command_of(pid):
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""


def parent_of(pid):
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
