"""A job outlives the process that works at it."""

import sqlite3
import time

import httpx
import pytest

from tests.reliability.service import TASK, serving, upload_files

NUM_EPISODES = 12


def test_killed_in_the_middle_of_a_job(tmp_path):
    data, environment = tmp_path / "data", {"ROBOPROMPT_EXTRACT_AT_ONCE": "5"}
    with serving(data, environment) as service:
        for number in range(NUM_EPISODES):
            httpx.post(f"{service.url}/episodes", files=upload_files(number)).raise_for_status()
        change = {"keyframes": {"rule": "uniform", "interval": 10}}
        accepted = httpx.put(f"{service.url}/tasks/{TASK}", json=change)
        assert (accepted.status_code, accepted.json()["num_episodes"]) == (202, NUM_EPISODES)
        assert httpx.put(f"{service.url}/tasks/{TASK}", json=change).status_code in (409, 200)
        service.kill()
    release_claims(data)
    with serving(data, environment) as service:
        job = wait_for(service.url + accepted.headers["location"])
        assert (job["status"], job["num_extracted"], job["error"]) == ("done", NUM_EPISODES, None)
        assert httpx.get(f"{service.url}/jobs", params={"task": TASK}).json()["jobs"] == [job]
        listed = httpx.get(f"{service.url}/episodes").json()["episodes"]
        assert [[k["index"] for k in item["keyframes"]] for item in listed] == [[10, 20]] * NUM_EPISODES
        assert httpx.get(f"{service.url}/tasks/{TASK}").json()["keyframes"]["rule"] == "uniform"


def release_claims(data):
    """Instead of waiting for a minute until the dead process's claim runs out."""
    with sqlite3.connect(data / "roboprompt.db") as connection:
        connection.execute("UPDATE jobs SET claimed_until = created_at")
    connection.close()


def wait_for(url):
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        job = httpx.get(url).json()
        if job["status"] in ("done", "failed"):
            return job
        time.sleep(0.1)
    pytest.fail(f"still {job}")
