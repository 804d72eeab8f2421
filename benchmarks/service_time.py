"""What a prediction costs the service outside the LLM."""

import asyncio
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import httpx

from app.evaluation.server import running
from app.llm.base import CompletionRequest, complete
from app.llm.computed import ScriptedModel
from app.pipeline.prompt import Prompt
from benchmarks import scenes
from roboprompt_client.client import RoboPromptClient

NUM_DEMONSTRATIONS = 10
NUM_REQUESTS = 400
ROUNDS = 4
TIMEOUT_S = 60.0  # of a request, on a busy machine
TASK = "put_in_box"


@dataclass(frozen=True)
class Cost:
    """Of one request, in milliseconds.

    Attributes:
        cpu_ms: of the server's process, all threads; the mean of the best of some rounds, as noise only adds.
        wall_ms: as the client sees it, median.
    """

    cpu_ms: float
    wall_ms: float


def measure() -> dict[str, Cost]:
    """The cost of each case."""
    with tempfile.TemporaryDirectory(prefix="roboprompt-") as folder:
        data = Path(folder)
        with _service(data) as (http, _), RoboPromptClient(str(http.base_url)) as client:
            scenes.teach(client, TASK, NUM_DEMONSTRATIONS)
            reply = str(_predicted(http, 0, model="nearest").json()["reply_text"])
        with _service(data, default_model="scripted", scripted_replies=json.dumps([reply])) as (http, pid):
            cost = _cost(pid, lambda seed: _predicted(http, seed))
    return {f"{NUM_DEMONSTRATIONS} episodes stored": cost, "of it the scripted LLM": asyncio.run(_scripted(reply))}


async def _scripted(reply: str) -> Cost:
    """What the stand-in for an LLM takes of a prediction."""
    model = ScriptedModel([reply])
    started_s, cpu_s = time.perf_counter(), time.process_time()
    for _ in range(NUM_REQUESTS):
        await complete(model, CompletionRequest(Prompt("", "", "")))
    spent_s = time.process_time() - cpu_s, time.perf_counter() - started_s
    return Cost(*(1000 * seconds / NUM_REQUESTS for seconds in spent_s))


@contextmanager
def _server(command: Sequence[str], environment: Mapping[str, str], log: Path) -> Iterator[tuple[httpx.Client, int]]:
    """A server's client, and the id of its process."""
    with running(command, environment, log) as (url, process), httpx.Client(base_url=url, timeout=TIMEOUT_S) as http:
        yield http, process.pid


def _service(data: Path, **settings: str) -> AbstractContextManager[tuple[httpx.Client, int]]:
    """The service on the folder `data`; settings by their names in `app.settings`."""
    environment = {f"ROBOPROMPT_{name.upper()}": value for name, value in {"warm_up": "false", **settings}.items()}
    return _server(["app.cli", "serve", "--data", str(data)], environment, data / "server.log")


def _predicted(http: httpx.Client, seed: int, **how: Any) -> httpx.Response:  # noqa: ANN401
    """A prediction in the representation of small models."""
    body = {**scenes.question(TASK, seed), "representation": "object_frame", **how}
    return http.post("/predict", json=body).raise_for_status()


def _cost(pid: int, send: Callable[[int], object]) -> Cost:
    """The cost of one of `NUM_REQUESTS` in `ROUNDS` rounds, after a tenth as many to warm up.

    Args:
        pid: of the server.
        send: the request of that number, and its answer.
    """
    for k in range(NUM_REQUESTS // 10):
        send(k)
    walls_s: list[float] = []
    cpus_s: list[float] = []
    for round_ in range(ROUNDS):
        numbers = range(round_, NUM_REQUESTS, ROUNDS)
        before_s = _cpu_s(pid)
        for k in numbers:
            started_s = time.perf_counter()
            send(k)
            walls_s.append(time.perf_counter() - started_s)
        cpus_s.append((_cpu_s(pid) - before_s) / len(numbers))
    return Cost(1000 * min(cpus_s), 1000 * median(walls_s))


def _cpu_s(pid: int) -> float:
    """CPU time, user and system, of all threads of a process until now, without its children; in steps of 10 ms."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    for name, measured in measure().items():
        print(f"{name}: {measured.cpu_ms:.2f} ms CPU, {measured.wall_ms:.2f} ms wall")  # noqa: T201
