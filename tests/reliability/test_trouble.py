"""A disk that is full, a database that is locked: clear refusals, and recovery without a restart."""

import resource
import sqlite3

import httpx
import pytest

from tests.reliability.service import QUESTION, serving, upload_files

STREAM = {"Accept": "text/event-stream"}


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    data = tmp_path_factory.mktemp("trouble") / "data"
    with serving(data) as running:
        running.data = data
        yield running


def upload(service, number):
    return httpx.post(f"{service.url}/episodes", files=upload_files(number), timeout=60)


def predict(service, headers=None):
    return httpx.post(f"{service.url}/predict", json=QUESTION, headers=headers, timeout=60)


def assert_refused(answer, words):
    problem = answer.json()
    assert answer.status_code == problem["status"] == 503, problem
    assert answer.headers["content-type"] == "application/problem+json"
    assert (problem["type"], answer.headers["retry-after"]) == ("/problems/store-unavailable", "1")
    assert words in problem["detail"]
    assert "Traceback" not in answer.text
    assert not any(word.count("/") > 1 for word in problem["detail"].split())  # a path


def test_files_cannot_grow(service):
    """The kernel refuses every write beyond a size, as it does when a disk is full (EFBIG instead of ENOSPC)."""
    assert upload(service, 0).status_code == 201
    before = httpx.get(f"{service.url}/episodes").json()
    unlimited = resource.prlimit(service.process.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(service.process.pid, resource.RLIMIT_FSIZE, (100, unlimited[1]))
    try:
        assert_refused(upload(service, 1), "blob storage: File too large: free space on the service's disk")
        assert_refused(predict(service), "database")
        assert_refused(predict(service, STREAM), "database")  # before any action
        assert httpx.get(f"{service.url}/episodes").json() == before
        assert httpx.get(f"{service.url}/healthz").is_success
    finally:
        resource.prlimit(service.process.pid, resource.RLIMIT_FSIZE, unlimited)
    assert upload(service, 1).status_code == 201
    assert predict(service).status_code == 200
    assert list(service.data.glob("blobs/??/??/.tmp-*")) == []


def test_database_locked_by_another_program(service):
    other = sqlite3.connect(service.data / "roboprompt.db", isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    assert_refused(upload(service, 2), "database is locked")
    assert httpx.get(f"{service.url}/episodes").is_success
    other.close()
    assert upload(service, 2).status_code == 201
