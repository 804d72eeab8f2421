"""A real service that can be killed, the load that it bears meanwhile, and what must hold afterwards."""

import hashlib
import itertools
import json
import os
import random
import signal
import tempfile
import threading
import time
from contextlib import contextmanager, suppress
from datetime import timedelta

import cv2
import httpx
import numpy as np

from app.evaluation.server import free_port
from app.store import episodes, predictions
from app.store.store import Store, blob_digests
from app.store.trajectories import get_trajectory
from tests.episodes import arrays, camera, metadata, multipart, npz, pick_trajectory
from tests.forked import Forked

REPLY = "[[50, 50, 20, 0, 36, 36, 1]]"
ENVIRONMENT = {
    "ROBOPROMPT_DEFAULT_MODEL": "scripted",
    "ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([REPLY]),
    "ROBOPROMPT_WARM_UP": "false",
}
TASK = "pick"
QUESTION = metadata(TASK, {"cube": (0.2, 0.1, 0.8)}, unsupported="allow")


class Service:
    """`roboprompt serve` on `data`; `environment` is added to a scripted LLM."""

    def __init__(self, data, environment=None, arguments=()):
        port = free_port()
        self.url = f"http://127.0.0.1:{port}"
        command = ["app.evaluation.server", "app.cli", "serve", "--port", str(port), "--data", str(data), *arguments]
        self._log = tempfile.TemporaryFile("w+")  # noqa: SIM115  closed with the service
        self.process = Forked(
            command, {**ENVIRONMENT, **(environment or {})}, self._log, leashed=True, new_session=True
        )

    def wait_until_alive(self):
        deadline = time.monotonic() + 60
        with httpx.Client() as http:
            while time.monotonic() < deadline and self.process.poll() is None:
                with suppress(httpx.TransportError):
                    if http.get(f"{self.url}/healthz").is_success:
                        return
                time.sleep(0.02)
        raise AssertionError(self.log()[-3000:])

    def log(self):
        """What it has written so far."""
        self._log.seek(0)
        return self._log.read()

    def kill(self):
        """What `kill -9` does."""
        os.killpg(self.process.pid, signal.SIGKILL)
        self.close()

    def stop(self):
        """What a supervisor does: end by SIGTERM, as which uvicorn reports it after an orderly end."""
        self.process.send_signal(signal.SIGTERM)
        try:
            assert self.process.wait(30) == -signal.SIGTERM
        finally:
            self.close()

    def close(self):
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.stdin.close()
        self.process.wait()
        self._log.close()


@contextmanager
def serving(data, environment=None, arguments=()):
    service = Service(data, environment, arguments)
    try:
        service.wait_until_alive()
        yield service
    finally:
        service.close()


class Load:
    """Uploads with images, and predictions, from several threads, until the service is gone.

    Attributes:
        episodes: number of the upload -> id, of those acknowledged.
        predictions: ids of those acknowledged.
        sent: numbers of all uploads that were begun.
        statuses: every status that was answered.
    """

    def __init__(self, url=""):
        self.url = url
        self.episodes, self.predictions, self.sent, self.statuses = {}, set(), set(), set()
        self._numbers = itertools.count()
        self._stopped = threading.Event()

    @contextmanager
    def running(self, num_threads=4):
        """Load meanwhile."""
        self._stopped.clear()
        threads = [threading.Thread(target=self._run, args=(k,)) for k in range(num_threads)]
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            self._stopped.set()
            for thread in threads:
                thread.join()

    def _run(self, which):
        with suppress(httpx.TransportError), httpx.Client(base_url=self.url, timeout=60) as http:
            while not self._stopped.is_set():
                if which % 2 == 0 or not self.episodes:
                    self.upload(http, next(self._numbers))
                else:
                    self._predict(http)

    def upload(self, http, number):
        """Upload episode `number`, with a key: sent again it must not be stored twice."""
        self.sent.add(number)
        answer = http.post("/episodes", files=upload_files(number), headers={"Idempotency-Key": f"upload {number}"})
        self.statuses.add(answer.status_code)
        if answer.status_code == 201:
            self.episodes[number] = answer.json()["id"]
        return answer

    def _predict(self, http):
        answer = http.post("/predict", json=QUESTION)
        self.statuses.add(answer.status_code)
        if answer.status_code == 200:
            self.predictions.add(answer.json()["id"])

    def upload_missing(self):
        """Send again what was begun and not acknowledged."""
        with httpx.Client(base_url=self.url, timeout=60) as http:
            for number in sorted(self.sent - set(self.episodes)):
                assert self.upload(http, number).status_code == 201


def position_of(number):
    return (0.1 + number % 100 / 500, number // 100 % 100 / 500, 0.8)


def image_of(number):
    noise = np.random.default_rng(number).integers(0, 256, (48, 64, 3), np.uint8)
    return cv2.imencode(".png", noise)[1].tobytes()


def upload_files(number):
    position_m = position_of(number)
    document = metadata(TASK, {"cube": position_m}, cameras=[camera()])
    return multipart(document, npz(**arrays(pick_trajectory(position_m))), rgb_front=image_of(number))


def check(data, load):
    """Every acknowledged episode and prediction is there, whole; nothing is there in halves; no leftovers stay.

    Call it while nothing serves `data`. Returns how many episodes are stored and how many leftovers were swept.
    """
    store = Store.open(data)
    try:
        with store.read() as connection:
            assert connection.exec_driver_sql("PRAGMA integrity_check").scalar() == "ok"
            stored = episodes.all_of(connection, TASK) if load.episodes else ()
            by_id = {record.id: record for record in stored}
            for number, id_ in load.episodes.items():
                trajectory = get_trajectory(connection, id_)
                expected = pick_trajectory(position_of(number))
                assert trajectory.positions_m.tobytes() == expected.positions_m.tobytes(), f"episode {number}"
                assert by_id[id_].cameras[0].rgb_digest == hashlib.sha256(image_of(number)).hexdigest()
            for id_ in load.predictions:
                predictions.get(connection, id_)
            digests = blob_digests(connection)
            for record in stored:
                assert record.keyframes
                assert len(get_trajectory(connection, record.id)) == record.num_frames
        for digest in digests:
            store.blobs.read(digest)
        swept = store.sweep(timedelta(0))
        assert {path.name for path in (data / "blobs").glob("??/??/*")} == digests
    finally:
        store.close()
    return len(stored), swept


def kill_repeatedly(data, num_kills, seed=0, report=lambda **figures: None):
    """Kill the service at random moments under load; check after each kill, and once more what was sent again."""
    rng, load, leftovers = random.Random(seed), Load(), 0
    for kill in range(num_kills):
        with serving(data) as service:
            load.url = service.url
            if kill:
                load.upload_missing()
            with load.running():
                time.sleep(rng.uniform(0.05, 1.0))
                service.kill()
        num_stored, swept = check(data, load)
        leftovers += swept
        report(kills=kill + 1, acknowledged=len(load.episodes), stored=num_stored, swept=leftovers)
    with serving(data) as service:
        load.url = service.url
        load.upload_missing()
        service.stop()
    num_stored, _ = check(data, load)
    assert num_stored == len(load.sent) == len(load.episodes), "an episode was stored twice or lost"
    assert load.statuses <= {200, 201}, load.statuses
    return {
        "kills": num_kills,
        "episodes_acknowledged": len(load.episodes),
        "predictions_acknowledged": len(load.predictions),
        "lost": 0,
        "half_written": 0,
        "leftovers_swept": leftovers,
    }
