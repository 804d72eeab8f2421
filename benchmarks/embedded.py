"""The real embedded LLM behind the service: cached prefixes, streaming, several robots, tokens."""

import asyncio
import itertools
import json
import threading
import time
from collections.abc import Iterator
from contextlib import aclosing, contextmanager
from statistics import median
from typing import Any

import httpx
from httpx_sse import connect_sse

from app.evaluation.server import service
from app.evaluation.tables import TextTable
from app.llm.base import Completion, CompletionRequest, TextDelta
from app.llm.llm_settings import LlmSettings
from app.llm.registry import ModelRegistry
from app.pipeline.prompt import Prompt
from benchmarks import scenes
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.encoding import scene_json

NUM_DEMONSTRATIONS = 10
NUM_PROMPTS = 4  # as many as the embedded model keeps slots
CONCURRENT_ROBOTS = (1, 4, 8)
TIMEOUT_S = 300.0  # of a prediction, on a busy machine
ROBOTS_S = 30.0
WARMING_S = 15.0  # the prefix warmer waits for a second after an upload, then reads some 2000 tokens
AUTHORS = "the authors'"
FORMATS = (
    ("object_frame", "paper", "ours, for small models"),
    ("absolute", "paper", "the paper's"),
    ("absolute", "authors", AUTHORS),
)


def sections() -> Iterator[str]:
    """Measure one after the other, each on a service of its own where it matters, and yield headings and texts."""
    with _taught(NUM_PROMPTS) as client:
        asked = [_prompts(client, f"task_{k}") for k in range(NUM_PROMPTS)]
        prefixes = asyncio.run(_prefixes(asked))
        others = [*_streaming(client), *_robots(client.url), *_tokens(client)]
    yield "## Cached prefixes"
    yield (
        f"{prefixes} The first prediction after the upload of ten episodes takes {_first_s(warm=True):.2f} s where the"
        f" prefix was warmed in the background, {_first_s(warm=False):.2f} s where it was not."
    )
    yield from others


@contextmanager
def _taught(num_tasks: int, *, warm: bool = False) -> Iterator[RoboPromptClient]:
    """A service with tasks that differ in their demonstrations."""
    with service(warm_up=warm) as client:
        for k in range(num_tasks):
            scenes.teach(client, f"task_{k}", NUM_DEMONSTRATIONS, first_seed=100 * k)
        yield client


def _prompts(client: RoboPromptClient, task: str) -> list[dict[str, Any]]:
    """What two predictions for unseen scenes would ask the LLM."""
    scene = [{**scenes.question(task, seed), "dry_run": True} for seed in (90_001, 90_002)]
    with httpx.Client(base_url=client.url) as http:
        return [http.post("/predict", json=body).json() for body in scene]


async def _prefixes(asked: list[list[dict[str, Any]]]) -> str:
    """Each task's two prompts in turn, straight to a fresh LLM: nothing but the LLM is in the times."""
    registry = ModelRegistry(LlmSettings())
    try:
        await registry.warm_up()
        times = [[await _first_token(registry, document) for document in pair] for pair in asked]
    finally:
        await registry.aclose()
    (cold, warm) = zip(*times, strict=True)
    prompt_tokens = median(usage.prompt_tokens for _, usage in warm)
    cached_share = median(usage.cached_tokens / usage.prompt_tokens for _, usage in warm)
    cold_s, warm_s = (median(seconds for seconds, _ in which) for which in (cold, warm))
    return (
        f"Prompts of {prompt_tokens:.0f} tokens. Of a task's second prediction {cached_share:.1%} of the prompt tokens"
        f" are cached; its first token comes after {warm_s * 1000:.0f} ms instead of {cold_s:.2f} s"
        f" ({cold_s / warm_s:.0f} times sooner)."
    )


async def _first_token(registry: ModelRegistry, document: dict[str, Any]) -> tuple[float, Any]:
    """Seconds to the first piece of the reply, and the usage."""
    prompt = Prompt(document["prompt"]["system"], document["prompt"]["user"], "", ("\n",), document["grammar"])
    started_s, first_s = time.perf_counter(), None
    async with aclosing(registry.get().stream(CompletionRequest(prompt, timeout_s=TIMEOUT_S))) as pieces:
        async for piece in pieces:
            if isinstance(piece, TextDelta):
                first_s = first_s or time.perf_counter() - started_s
            elif isinstance(piece, Completion):
                assert first_s is not None
                return first_s, piece.usage
    raise AssertionError("a stream ends with its completion")


def _streaming(client: RoboPromptClient) -> Iterator[str]:
    client.predict("task_0", scenes.INSTRUCTION, scenes.observation(90_000), timeout_s=TIMEOUT_S)
    runs: list[tuple[int, float, float]] = []
    for seed in range(91_000, 91_005):
        started_s, first_s = time.perf_counter(), 0.0
        document = {"task": "task_0", "instruction": scenes.INSTRUCTION, **scene_json(scenes.observation(seed))}
        with (
            httpx.Client(base_url=client.url, timeout=TIMEOUT_S) as http,
            connect_sse(http, "POST", "/predict", json={**document, "timeout_s": TIMEOUT_S}) as source,
        ):
            for event in source.iter_sse():
                first_s = first_s or (time.perf_counter() - started_s if event.event == "action" else 0.0)
                if event.event == "done":
                    runs.append((len(json.loads(event.data)["actions"]), first_s, time.perf_counter() - started_s))
    num_actions, first_s, whole_s = (median(column) for column in zip(*runs, strict=True))
    yield "## Streaming"
    yield (
        f"With a warm prefix, {num_actions:.0f} actions: the first after {first_s:.2f} s, the whole reply after"
        f" {whole_s:.2f} s ({first_s / whole_s:.0%})."
    )


def _robots(url: str) -> Iterator[str]:
    """Robots that ask again as soon as they are answered; their first answers are not counted."""
    rows = []
    for k, number in enumerate(CONCURRENT_ROBOTS):
        task = f"task_{k}"
        with httpx.Client(base_url=url, timeout=TIMEOUT_S) as http:
            _ask(http, task, seed=90_000)
        first_s, first = _together(url, number, task, seconds=0.0)
        seconds, done = _together(url, number, task, seconds=ROBOTS_S)
        failed = [*first, *done].count(False)
        rows.append([str(number), f"{first_s:.1f}", f"{60 * sum(done) / seconds:.0f}", str(failed)])
    yield "## Several robots"
    yield (
        f"Each asks for another scene of one task as soon as it is answered, {ROBOTS_S:.0f} s; the embedded model has"
        " four slots, one of which knows the task at first."
    )
    head = ("robots at once", "until each had its first answer, s", "then predictions a minute", "failed")
    yield TextTable(head, [rows]).markdown()


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


def _tokens(client: RoboPromptClient) -> Iterator[str]:
    usages = {}
    for representation, prompt_format, name in FORMATS:
        how = {"representation": representation, "prompt_format": prompt_format, "system_prompt": "none"}
        fields = {**how, "unsupported": "allow"}  # tokens count, not whether the embedded model masters the format
        answer = client.predict("task_0", scenes.INSTRUCTION, scenes.observation(92_000), timeout_s=TIMEOUT_S, **fields)
        usages[name] = answer.response["usage"]
    rows = [
        [name, f"{used['prompt_tokens']}", f"{used['completion_tokens']}", f"{used['prompt_tokens'] / theirs:.2f}"]
        for theirs in [usages[AUTHORS]["prompt_tokens"]]
        for name, used in usages.items()
    ]
    yield "## Tokens of a prediction"
    yield "The same ten demonstrations and the same scene, no system prompt, tokens of the embedded model."
    yield TextTable(("format", "prompt", "reply", "prompt against the authors'"), [rows]).markdown()


def _first_s(*, warm: bool) -> float:
    """The first prediction after ten uploads, the LLM running; with time to warm the prefix, if it is to be warmed."""
    with _taught(1, warm=warm) as client:
        client.predict("task_0", scenes.INSTRUCTION, scenes.observation(90_000), timeout_s=TIMEOUT_S)
        scenes.teach(client, "new", NUM_DEMONSTRATIONS, first_seed=5000)
        if warm:
            time.sleep(WARMING_S)
        started_s = time.perf_counter()
        client.predict("new", scenes.INSTRUCTION, scenes.observation(90_000), timeout_s=TIMEOUT_S)
        return time.perf_counter() - started_s
