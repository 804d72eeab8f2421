"""What a prediction costs the service outside the LLM; with many stored episodes: `benchmarks.growth`."""

import asyncio
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import httpx

from app.evaluation.server import running
from app.llm.base import CompletionRequest, complete
from app.llm.computed import ScriptedModel
from app.pipeline.prompt import Prompt
from benchmarks import scenes
from benchmarks.processes import Cost, Server, cost, service
from roboprompt_client.client import RoboPromptClient

NUM_DEMONSTRATIONS = 10
NUM_REQUESTS = 400
TASK = "put_in_box"


def measure() -> dict[str, Cost]:
    """The cost of each case."""
    with tempfile.TemporaryDirectory(prefix="roboprompt-") as folder:
        data = Path(folder)
        costs = {"FastAPI hello-world": _hello(data / "hello.log")}
        teach(data)
        reply = copied_reply(data)
        costs[f"{NUM_DEMONSTRATIONS} episodes stored"] = _predictions(data, reply)
    return {**costs, "of it the scripted LLM": asyncio.run(_scripted(reply))}


async def _scripted(reply: str) -> Cost:
    """What the stand-in for an LLM takes of a prediction."""
    model = ScriptedModel([reply])
    started_s, cpu_s = time.perf_counter(), time.process_time()
    for _ in range(NUM_REQUESTS):
        await complete(model, CompletionRequest(Prompt("", "", "")))
    spent_s = time.process_time() - cpu_s, time.perf_counter() - started_s
    return Cost(*(1000 * seconds / NUM_REQUESTS for seconds in spent_s))


def teach(data: Path) -> None:
    """Upload the demonstrations."""
    with service(data, warm_up="false") as server, RoboPromptClient(server.url) as client:
        for seed in range(NUM_DEMONSTRATIONS):
            scene = scenes.observation(seed)
            client.upload(TASK, scenes.INSTRUCTION, scenes.trajectory(scene), scene)


def _hello(log: Path) -> Cost:
    with running(["benchmarks.hello"], {}, log) as (url, process), httpx.Client(base_url=url) as http:
        return cost(Server(url, process.pid), lambda _: http.get("/healthz"), NUM_REQUESTS)


def copied_reply(data: Path) -> str:
    """What an LLM that copies the demonstrations' rows replies."""
    with service(data, warm_up="false") as server, httpx.Client(base_url=server.url) as http:
        answer = http.post("/predict", json={**asked(0), "model": "nearest"}).raise_for_status()
        return str(answer.json()["reply_text"])


def _predictions(data: Path, reply: str) -> Cost:
    with (
        service(data, warm_up="false", default_model="scripted", scripted_replies=json.dumps([reply])) as server,
        httpx.Client(base_url=server.url) as http,
    ):
        return cost(server, lambda seed: http.post("/predict", json=asked(seed)).raise_for_status(), NUM_REQUESTS)


def asked(seed: int) -> dict[str, Any]:
    """A prediction by the scripted LLM in the representation of small models."""
    return {**scenes.question(TASK, seed), "representation": "object_frame"}


if __name__ == "__main__":
    for name, measured in measure().items():
        print(f"{name}: {measured.cpu_ms:.2f} ms CPU, {measured.wall_ms:.2f} ms wall")  # noqa: T201
