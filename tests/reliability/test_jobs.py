"""A job outlives the process that works at it."""

import json
import sqlite3
import time

import httpx
import pytest

from tests.episodes import hand_arrays, metadata, multipart, npz, pick_trajectory
from tests.forked import run
from tests.reliability.service import TASK, serving, upload_files

NUM_EPISODES = 12
CHANGE = {"keyframes": {"rule": "uniform", "interval": 10}}


def ask_for_a_job(service):
    for number in range(NUM_EPISODES):
        httpx.post(f"{service.url}/episodes", files=upload_files(number)).raise_for_status()
    return httpx.put(f"{service.url}/tasks/{TASK}", json=CHANGE)


def test_killed_in_the_middle_of_a_job(tmp_path):
    data, environment = tmp_path / "data", {"ROBOPROMPT_EXTRACT_AT_ONCE": "5"}
    with serving(data, environment) as service:
        accepted = ask_for_a_job(service)
        assert (accepted.status_code, accepted.json()["num_episodes"]) == (202, NUM_EPISODES)
        assert httpx.put(f"{service.url}/tasks/{TASK}", json=CHANGE).status_code in (409, 200)
        service.kill()
    release_claims(data)
    with serving(data, environment) as service:
        job = wait_for(service.url + accepted.headers["location"])
        assert (job["status"], job["num_extracted"], job["error"]) == ("done", NUM_EPISODES, None)
        assert httpx.get(f"{service.url}/jobs", params={"task": TASK}).json()["jobs"] == [job]
        listed = httpx.get(f"{service.url}/episodes").json()["episodes"]
        assert [[k["index"] for k in item["keyframes"]] for item in listed] == [[10, 20]] * NUM_EPISODES
        assert httpx.get(f"{service.url}/tasks/{TASK}").json()["keyframes"]["rule"] == "uniform"


def test_a_command_works_at_jobs_that_the_service_leaves(tmp_path):
    data = tmp_path / "data"
    with serving(data, {"ROBOPROMPT_EXTRACT_AT_ONCE": "5", "ROBOPROMPT_WORK_AT_JOBS": "false"}) as service:
        job = ask_for_a_job(service).json()
        time.sleep(2.0)
        assert httpx.get(f"{service.url}/jobs/{job['id']}").json()["status"] == "queued"
        done = work_at_jobs(data)
        assert (done["jobs"], done["episodes"]) == (1, NUM_EPISODES)
        job = httpx.get(f"{service.url}/jobs/{job['id']}").json()
        assert (job["status"], job["num_extracted"]) == ("done", NUM_EPISODES)
        listed = httpx.get(f"{service.url}/episodes").json()["episodes"]
        assert [[k["index"] for k in item["keyframes"]] for item in listed] == [[10, 20]] * NUM_EPISODES


def test_what_fails_in_a_worker_is_the_jobs_error(tmp_path):
    data = tmp_path / "data"
    with serving(data, {"ROBOPROMPT_EXTRACT_AT_ONCE": "0", "ROBOPROMPT_WORK_AT_JOBS": "false"}) as service:
        place_m = (0.1, 0.1, 0.78)
        parts = multipart(metadata(TASK, {"cube": place_m}), npz(**hand_arrays(pick_trajectory(place_m))))
        httpx.post(f"{service.url}/episodes", files=parts).raise_for_status()
        change = {"keyframes": {"rule": "authors"}}  # which needs joints
        job = httpx.put(f"{service.url}/tasks/{TASK}", json=change).json()
        work_at_jobs(data)
        job = httpx.get(f"{service.url}/jobs/{job['id']}").json()
    assert job["status"] == "failed"
    assert job["error"].startswith("episode "), job


def work_at_jobs(data):
    done = run("app.cli", "jobs", "--data", str(data))
    done.check_returncode()
    return json.loads(done.stdout)


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
