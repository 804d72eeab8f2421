"""The service is killed, and nothing acknowledged is lost. The torture does the same 200 times."""

import os
import signal
import sqlite3
import time
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

from app.store.store import Store
from tests.reliability.service import Load, check, kill_repeatedly, serving, upload_files


def test_killed_at_random_moments_under_load(tmp_path):
    figures = kill_repeatedly(tmp_path / "data", num_kills=3)
    assert figures["episodes_acknowledged"] > 3


def test_start_sweeps_what_crashes_left(tmp_path):
    data = tmp_path / "data"
    store = Store.open(data)
    orphan = data / "blobs" / (digest := store.blobs.put(b"its row was never committed"))[:2] / digest[2:4] / digest
    store.close()
    half = orphan.with_name(".tmp-half")
    half.write_bytes(b"hal")
    for path in (orphan, half):
        os.utime(path, (time.time() - 7200,) * 2)
    with serving(data):
        deadline = time.monotonic() + 10
        while (orphan.exists() or half.exists()) and time.monotonic() < deadline:
            time.sleep(0.05)
    assert not orphan.exists()
    assert not half.exists()


def test_stopped_under_load_loses_nothing(tmp_path):
    data = tmp_path / "data"
    with serving(data) as service:
        load = Load(service.url)
        with load.running():
            time.sleep(1.0)
            service.stop()
    assert load.statuses <= {200, 201}
    assert load.episodes
    check(data, load)


def test_what_is_under_way_is_finished_and_what_comes_later_refused(tmp_path):
    data = tmp_path / "data"
    with serving(data) as service, ThreadPoolExecutor(1) as pool:
        assert httpx.post(f"{service.url}/episodes", files=upload_files(0)).status_code == 201
        holding_up = sqlite3.connect(data / "roboprompt.db", isolation_level=None)
        holding_up.execute("BEGIN IMMEDIATE")
        under_way = pool.submit(httpx.post, f"{service.url}/episodes", files=upload_files(1), timeout=60)
        time.sleep(1.0)
        service.process.send_signal(signal.SIGTERM)
        time.sleep(0.5)
        with pytest.raises(httpx.ConnectError):
            httpx.get(f"{service.url}/healthz")
        holding_up.close()
        assert under_way.result().status_code == 201
        assert service.process.wait(30) == -signal.SIGTERM
