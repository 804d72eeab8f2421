"""The real embedded LLM behind the service: cached prefixes, streaming, several robots, tokens."""

import asyncio
import itertools
import json
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import aclosing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import httpx

from app.llm.base import CompletionRequest, TextDelta
from app.llm.llm_settings import LlmSettings
from app.llm.registry import ModelRegistry
from app.pipeline.prompt import Prompt
from benchmarks import scenes
from benchmarks.processes import service
from roboprompt_client.answers import PredictedActions
from roboprompt_client.client import RoboPromptClient

NUM_DEMONSTRATIONS = 10
NUM_PROMPTS = 4  # as many as the embedded model keeps slots
CONCURRENT_ROBOTS = (1, 4, 8)
TIMEOUT_S = 300.0  # of a prediction, on a busy machine
ROBOTS_S = 30.0
WARMING_S = 15.0  # the prefix warmer waits for a second after an upload, then reads some 2000 tokens
FORMATS = (
    ("object_frame", "paper", "ours, for small models"),
    ("absolute", "paper", "the paper's"),
    ("absolute", "authors", "the authors'"),
)


@dataclass(frozen=True)
class Prefixes:
    """Medians over prompts of ten demonstrations each.

    Attributes:
        cached_share: of the second prediction's prompt tokens.
        cold_s, warm_s: to the first token of the first and the second prediction.
    """

    prompt_tokens: float
    cached_share: float
    cold_s: float
    warm_s: float


@dataclass(frozen=True)
class Streaming:
    """Medians of streamed predictions with a warm prefix."""

    num_actions: float
    first_action_s: float
    whole_s: float


@dataclass(frozen=True)
class Robots:
    """So many robots that ask at once.

    Attributes:
        first_s: until each had its first answer, the LLM's slots being new to the task but for one.
    """

    robots: int
    first_s: float
    predictions_per_minute: float
    failures: int


@dataclass(frozen=True)
class Tokens:
    """Of one prediction with ten demonstrations, by the embedded model's tokenizer."""

    name: str
    prompt: int
    completion: int


@dataclass(frozen=True)
class AfterUpload:
    """Seconds from the question to the answer of the first prediction after the uploads of a task."""

    prefix_warmed_s: float
    prefix_cold_s: float


@dataclass(frozen=True)
class Measured:
    """Everything of this module."""

    prefixes: Prefixes
    streaming: Streaming
    robots: tuple[Robots, ...]
    tokens: tuple[Tokens, ...]
    after_upload: AfterUpload


def measure() -> Measured:
    """Measure one after the other, each on a service of its own where it matters."""
    with _taught(NUM_PROMPTS) as client:
        asked = [_prompts(client, f"task_{k}") for k in range(NUM_PROMPTS)]
        prefixes = asyncio.run(_prefixes(asked))
        streaming = _streaming(client)
        robots = tuple(_robots(client.url, number, f"task_{k}") for k, number in enumerate(CONCURRENT_ROBOTS))
        tokens = tuple(_tokens(client, *style) for style in FORMATS)
    return Measured(prefixes, streaming, robots, tokens, AfterUpload(_first(warm=True), _first(warm=False)))


@contextmanager
def _taught(num_tasks: int, *, warm: bool = False) -> Iterator[RoboPromptClient]:
    """A service with tasks that differ in their demonstrations."""
    with (
        tempfile.TemporaryDirectory(prefix="roboprompt-") as folder,
        service(Path(folder), warm_up=str(warm)) as server,
        RoboPromptClient(server.url) as client,
    ):
        for k in range(num_tasks):
            _teach(client, f"task_{k}", first_seed=100 * k)
        yield client


def _teach(client: RoboPromptClient, task: str, first_seed: int) -> None:
    for seed in range(first_seed, first_seed + NUM_DEMONSTRATIONS):
        scene = scenes.observation(seed)
        client.upload(task, scenes.INSTRUCTION, scenes.trajectory(scene), scene)


def _prompts(client: RoboPromptClient, task: str) -> list[dict[str, Any]]:
    """What two predictions for unseen scenes would ask the LLM."""
    scene = [{**scenes.question(task, seed), "dry_run": True} for seed in (90_001, 90_002)]
    with httpx.Client(base_url=client.url) as http:
        return [http.post("/predict", json=body).json() for body in scene]


async def _prefixes(asked: list[list[dict[str, Any]]]) -> Prefixes:
    """Each task's two prompts in turn, straight to a fresh LLM: nothing but the LLM is in the times."""
    registry = ModelRegistry(LlmSettings())
    try:
        await registry.warm_up()
        times = [[await _first_token(registry, document) for document in pair] for pair in asked]
    finally:
        await registry.aclose()
    (cold, warm) = zip(*times, strict=True)
    return Prefixes(
        prompt_tokens=median(usage.prompt_tokens for _, usage in warm),
        cached_share=median(usage.cached_tokens / usage.prompt_tokens for _, usage in warm),
        cold_s=median(seconds for seconds, _ in cold),
        warm_s=median(seconds for seconds, _ in warm),
    )


async def _first_token(registry: ModelRegistry, document: dict[str, Any]) -> tuple[float, Any]:
    """Seconds to the first piece of the reply, and the usage."""
    prompt = Prompt(document["prompt"]["system"], document["prompt"]["user"], "", ("\n",), document["grammar"])
    started_s, first_s = time.perf_counter(), None
    async with aclosing(registry.get().stream(CompletionRequest(prompt, timeout_s=TIMEOUT_S))) as pieces:
        async for piece in pieces:
            if isinstance(piece, TextDelta):
                first_s = first_s or time.perf_counter() - started_s
            else:
                assert first_s is not None
                return first_s, piece.usage
    raise AssertionError("a stream ends with its completion")


def _streaming(client: RoboPromptClient) -> Streaming:
    client.predict("task_0", scenes.INSTRUCTION, scenes.observation(90_000), timeout_s=TIMEOUT_S)
    runs: list[tuple[int, float, float]] = []
    for seed in range(91_000, 91_005):
        started_s, first_s = time.perf_counter(), 0.0
        for item in client.stream("task_0", scenes.INSTRUCTION, scenes.observation(seed), timeout_s=TIMEOUT_S):
            first_s = first_s or time.perf_counter() - started_s
            if isinstance(item, PredictedActions):
                runs.append((len(item.actions), first_s, time.perf_counter() - started_s))
    return Streaming(*(median(column) for column in zip(*runs, strict=True)))


def _robots(url: str, number: int, task: str) -> Robots:
    """`number` robots that ask again as soon as they are answered; their first answers are not counted."""
    with httpx.Client(base_url=url, timeout=TIMEOUT_S) as http:
        _ask(http, task, seed=90_000)
    first_s, first = _together(url, number, task, seconds=0.0)
    seconds, done = _together(url, number, task, seconds=ROBOTS_S)
    return Robots(number, first_s, 60 * sum(done) / seconds, [*first, *done].count(False))


def _together(url: str, number: int, task: str, seconds: float) -> tuple[float, list[bool]]:
    """Each robot asks until `seconds` are over, at least once: how long it took, and whether each was answered."""
    done: list[bool] = []
    started_s = time.monotonic()

    def robot(first_seed: int) -> None:
        with httpx.Client(base_url=url, timeout=TIMEOUT_S) as http:
            for seed in itertools.count(first_seed):
                done.append(_ask(http, task, seed))
                if time.monotonic() > started_s + seconds:
                    return

    threads = [threading.Thread(target=robot, args=(100_000 * k,)) for k in range(1, number + 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return time.monotonic() - started_s, done


def _ask(http: httpx.Client, task: str, seed: int) -> bool:
    return http.post("/predict", json={**scenes.question(task, seed), "timeout_s": TIMEOUT_S}).is_success


def _tokens(client: RoboPromptClient, representation: str, prompt_format: str, name: str) -> Tokens:
    how = {"representation": representation, "prompt_format": prompt_format, "system_prompt": "none"}
    fields = {**how, "unsupported": "allow"}  # tokens count, not whether the embedded model masters the format
    answer = client.predict("task_0", scenes.INSTRUCTION, scenes.observation(92_000), timeout_s=TIMEOUT_S, **fields)
    usage = answer.response["usage"]
    return Tokens(name, usage["prompt_tokens"], usage["completion_tokens"])


def _first(*, warm: bool) -> float:
    """The first prediction after ten uploads, the LLM running; with time to warm the prefix, if it is to be warmed."""
    with _taught(1, warm=warm) as client:
        client.predict("task_0", scenes.INSTRUCTION, scenes.observation(90_000), timeout_s=TIMEOUT_S)
        _teach(client, "new", first_seed=5000)
        if warm:
            time.sleep(WARMING_S)
        started_s = time.perf_counter()
        client.predict("new", scenes.INSTRUCTION, scenes.observation(90_000), timeout_s=TIMEOUT_S)
        return time.perf_counter() - started_s


def as_json(measured: Measured) -> str:
    """For a look without the report."""
    return json.dumps(measured, default=vars, indent=1)


if __name__ == "__main__":
    print(as_json(measure()))  # noqa: T201
