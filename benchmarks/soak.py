"""Mixed load from 16 clients for some minutes, with an LLM that fails in every way; what stays flat and what leaks.

`python -m benchmarks.soak --minutes 30`. Prints one JSON object; exits with 1 if a promise does not hold.
"""

import argparse
import asyncio
import collections
import json
import multiprocessing
import os
import random
import sys
import tempfile
import threading
import time
from pathlib import Path

import httpx
import numpy as np

from tests.episodes import metadata
from tests.llm.loopback import after, delta, hang_up, loopback, status, streamed
from tests.reliability.service import REPLY, TASK, Service, upload_files

NUM_CLIENTS = 16
TIMEOUT_S = 3.0  # of a prediction; its answer may take a moment longer
MARGIN_S = 2.0
HEALTH_P99_S = 0.050
MEMORY_GROWTH = 0.10  # from the first third's end to the last: what the database's and Python's caches take
FAULTS = {
    "good": 70,
    "junk": 5,
    "500": 5,
    "429": 5,
    "hang up": 5,
    "late": 5,
    "broken off": 5,
}


async def serve_llm(ready, finished):
    """The LLM, until `finished`; tells its address to `ready`."""
    rng = random.Random(0)
    good = streamed(delta(REPLY), delta("", "stop"), "[DONE]", delay_s=0.02)
    answers = {
        "good": good,
        "junk": streamed(delta("I would rather not."), delta("", "stop"), "[DONE]"),
        "500": status(500, b"{}"),
        "429": status(429, b"{}"),
        "hang up": hang_up,
        "late": after(2 * TIMEOUT_S, good),
        "broken off": streamed(delta("[[50, 50"), end=b""),
    }

    async def answer(writer):
        await answers[rng.choices(list(FAULTS), list(FAULTS.values()))[0]](writer)

    async with loopback(answer) as (url, _):
        ready(url)
        while not finished.is_set():
            await asyncio.sleep(0.1)


class Client(threading.Thread):
    """Uploads, lists, predicts whole and streamed, in turn at random."""

    def __init__(self, url, seed, stop, numbers):
        super().__init__()
        self.url, self.stop, self.numbers = url, stop, numbers
        self.rng = random.Random(seed)
        self.latencies, self.statuses, self.late = collections.defaultdict(list), collections.Counter(), []

    def run(self):
        with httpx.Client(base_url=self.url, timeout=60) as http:
            while not self.stop.is_set():
                kind = self.rng.choices(["predict", "stream", "upload", "list"], [5, 2, 1, 2])[0]
                started = time.perf_counter()
                try:
                    code = getattr(self, f"_{kind}")(http).status_code
                except httpx.TransportError as error:
                    code = type(error).__name__
                elapsed = time.perf_counter() - started
                self.latencies[kind].append(elapsed)
                self.statuses[f"{kind} {code}"] += 1
                if elapsed > TIMEOUT_S + MARGIN_S:
                    self.late.append((kind, code, round(elapsed, 2)))
                time.sleep(self.rng.uniform(0, 0.4))

    def ask_once(self):
        with httpx.Client(base_url=self.url, timeout=60) as http:
            self._predict(http)

    def _predict(self, http, **headers):
        body = {**metadata(TASK, {"cube": (0.2, 0.1, 0.8)}), "timeout_s": TIMEOUT_S}
        return http.post("/predict", json=body, headers=headers)

    def _stream(self, http):
        return self._predict(http, Accept="text/event-stream")

    def _upload(self, http):
        return http.post("/episodes", files=upload_files(next(self.numbers)))

    def _list(self, http):
        return http.get(self.rng.choice(["/episodes", "/predictions", "/tasks"]), params={"limit": 20})


def watch_health(url, stop, answer):
    """In a process of its own: in this one the clients' threads would keep it waiting."""
    latencies = []
    with httpx.Client(base_url=url, timeout=60) as http:
        while not stop.is_set():
            started = time.perf_counter()
            http.get("/healthz").raise_for_status()
            latencies.append(time.perf_counter() - started)
            time.sleep(0.05)
    answer.put(latencies)


def state_of(pid):
    """Resident memory in MB, open files and open sockets of a process."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    targets = []
    for link in Path(f"/proc/{pid}/fd").iterdir():
        try:
            targets.append(os.readlink(link))
        except OSError:
            continue
    sockets = sum(target.startswith("socket:") for target in targets)
    return {"rss_mb": round(pages * 4096 / 1e6, 1), "files": len(targets) - sockets, "sockets": sockets}


def soak(minutes, data):
    addresses, finished, stop = [], threading.Event(), threading.Event()
    llm = threading.Thread(target=lambda: asyncio.run(serve_llm(addresses.append, finished)))
    llm.start()
    while not addresses:
        time.sleep(0.01)
    environment = {
        "ROBOPROMPT_DEFAULT_MODEL": "openai_compatible/default",
        "ROBOPROMPT_COMPATIBLE_BASE_URL": addresses[0],
        "ROBOPROMPT_LLM_PAUSE_S": "1",
    }
    service = Service(data, environment)
    try:
        service.wait_until_alive()
        return _run(service, minutes, stop)
    finally:
        stop.set()
        finished.set()
        service.close()
        llm.join()


def _run(service, minutes, stop):
    for number in range(10):
        httpx.post(f"{service.url}/episodes", files=upload_files(number)).raise_for_status()
    before = state_of(service.process.pid)
    samples, spawn = [], multiprocessing.get_context("spawn")
    answer, health_stop = spawn.Queue(), spawn.Event()
    numbers = iter(range(10, 10**9))
    clients = [Client(service.url, seed, stop, numbers) for seed in range(NUM_CLIENTS)]
    watcher = spawn.Process(target=watch_health, args=(service.url, health_stop, answer))
    for worker in (watcher, *clients):
        worker.start()
    ends = time.monotonic() + minutes * 60
    while time.monotonic() < ends:
        time.sleep(5)
        samples.append(state_of(service.process.pid))
    stop.set()
    health_stop.set()
    health = answer.get(timeout=60)
    for worker in (watcher, *clients):
        worker.join()
    time.sleep(8)  # keep-alive connections end after 5 s
    clients[0].ask_once()  # and those to the LLM, which it has closed, are noticed by the next request
    after_load = state_of(service.process.pid)
    service.stop()
    return _figures(minutes, clients, health, samples, before, after_load)


def _figures(minutes, clients, health, samples, before, after_load):
    statuses, latencies = collections.Counter(), collections.defaultdict(list)
    for client in clients:
        statuses.update(client.statuses)
        for kind, values in client.latencies.items():
            latencies[kind] += values
    third = len(samples) // 3
    memory = [sample["rss_mb"] for sample in samples]
    first, last = np.median(memory[third : 2 * third]), np.median(memory[-third:])
    late = [item for client in clients for item in client.late]
    figures = {
        "minutes": minutes,
        "load_average": os.getloadavg()[0],
        "clients": NUM_CLIENTS,
        "requests": sum(statuses.values()),
        "statuses": dict(sorted(statuses.items())),
        "late": late,
        "health_p50_ms": round(1000 * float(np.quantile(health, 0.5)), 1),
        "health_p99_ms": round(1000 * float(np.quantile(health, 0.99)), 1),
        "health_max_ms": round(1000 * max(health), 1),
        "p50_p99_ms": {k: [round(1000 * float(q)) for q in np.quantile(v, (0.5, 0.99))] for k, v in latencies.items()},
        "rss_mb": {"start": before["rss_mb"], "middle_third": first, "last_third": last, "end": after_load["rss_mb"]},
        "files": [before["files"], after_load["files"]],
        "sockets": [before["sockets"], after_load["sockets"]],
    }
    figures["promises"] = {
        "every request answered within its deadline": not late,
        "health p99 below 50 ms": figures["health_p99_ms"] < 1000 * HEALTH_P99_S,
        "memory flat": bool(last < first * (1 + MEMORY_GROWTH)),
        # a pooled connection to the database is three files, and the pool may have grown to its full size
        "no leaked sockets": after_load["sockets"] <= before["sockets"] + 2,
        "no undocumented answer": not [s for s in statuses if s.split(" ", 1)[1] == "500" or "Error" in s],
    }
    return figures


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30)
    with tempfile.TemporaryDirectory(prefix="roboprompt-soak-") as folder:
        figures = soak(parser.parse_args().minutes, Path(folder) / "data")
    sys.stdout.write(json.dumps(figures, indent=1) + "\n")
    sys.exit(not all(figures["promises"].values()))


if __name__ == "__main__":
    main()
