"""What llama.cpp takes for reading and writing alone: the least that a prediction waits, whatever stands around it."""

import random
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import httpx

from app.executors import usable_cores
from app.llm.llama.process import LlamaOptions, LlamaProcess
from app.llm.llama.weights import find_trimmed_weights
from app.llm.llm_settings import LlmSettings

MODEL = "gemma-3-270m"
THREADS = tuple(dict.fromkeys((1, usable_cores())))  # the last as the service has it
SLOTS = 4
CONTEXT_TOKENS = 2048
READ_NUMBERS = 120  # some 500 tokens
WRITTEN_TOKENS = 80  # a reply of five rows
REPEATS = 5
TIMEOUT_S = 120.0
SURPRISING = {"temperature": 3.0, "top_k": 0, "top_p": 1.0, "min_p": 0.0}  # nothing in it has been there before
ROWS = "; ".join(f"{k} A w: +{7 * k % 50} -{11 * k % 50} +{13 * k % 50} 0 36 36 1" for k in range(1, 7)) + "\n"


@dataclass(frozen=True)
class Arithmetic:
    """Tokens a second, medians, by llama.cpp's own account; no grammar.

    Attributes:
        reads: of a prompt of which nothing is cached.
        writes: one after the other, text that no draft foresees.
        copies: rows that the prompt has, by drafts that are tried as a whole.
        writes_together: of `SLOTS` replies at once, all of them, again without drafts.
        memory_mb: of the process, after that.
    """

    threads: int
    reads: float
    writes: float
    copies: float
    writes_together: float
    memory_mb: float


def measure() -> tuple[Arithmetic, ...]:
    """For each number of threads."""
    return tuple(_with_threads(number) for number in THREADS)


def _with_threads(number: int) -> Arithmetic:
    with _server(number) as ask, ThreadPoolExecutor(SLOTS) as together:
        dice = random.Random(number)
        read = [ask(prompt=_numbers(dice), n_predict=1)["prompt_per_second"] for _ in range(REPEATS)]
        written = [ask(**_surprising(dice))["predicted_per_second"] for _ in range(REPEATS)]
        copied = [ask(prompt=4 * ROWS, n_predict=WRITTEN_TOKENS)["predicted_per_second"] for _ in range(REPEATS)]
        at_once = [
            _rate(list(together.map(lambda body: ask(**body), [_surprising(dice) for _ in range(SLOTS)])))
            for _ in range(REPEATS)
        ]
        return Arithmetic(number, median(read), median(written), median(copied), median(at_once), ask.memory_mb())


def _numbers(dice: random.Random) -> str:
    return " ".join(str(dice.randrange(1000)) for _ in range(READ_NUMBERS))


def _surprising(dice: random.Random) -> dict[str, Any]:
    seed = dice.randrange(2**31)
    return {"prompt": "The arm", "n_predict": WRITTEN_TOKENS, "ignore_eos": True, "seed": seed, **SURPRISING}


def _rate(timings: list[dict[str, float]]) -> float:
    """All tokens by the time that the slowest reply took to be written."""
    return sum(item["predicted_n"] for item in timings) / max(item["predicted_ms"] for item in timings) * 1000


class _Ask:
    """Asks llama.cpp itself for a completion, and returns its own account of the times."""

    def __init__(self, process: LlamaProcess, http: httpx.Client) -> None:
        self._process = process
        self._http = http

    def __call__(self, **body: Any) -> dict[str, float]:  # noqa: ANN401
        asked = {"cache_prompt": False, "temperature": 0, **body}
        timings: dict[str, float] = self._http.post("/completion", json=asked).raise_for_status().json()["timings"]
        return timings

    def memory_mb(self) -> float:
        """What the process has in memory, its file of weights included."""
        status = Path(f"/proc/{self._process.pid}/status").read_text()
        kilobytes = next(line for line in status.splitlines() if line.startswith("VmRSS")).split()[1]
        return int(kilobytes) / 1024


@contextmanager
def _server(threads: int) -> Iterator[_Ask]:
    path = find_trimmed_weights(MODEL, LlmSettings())
    assert path, f"{MODEL} has no trimmed weights here"
    options = LlamaOptions(model=str(path()), slots=SLOTS, context_tokens=CONTEXT_TOKENS, threads=threads)
    process = LlamaProcess(options)
    try:
        with httpx.Client(
            base_url=process.server.base_url.removesuffix("/v1"),
            headers={"Authorization": f"Bearer {options.api_key}"},
            timeout=TIMEOUT_S,
            limits=httpx.Limits(max_keepalive_connections=0),  # llama.cpp closes connections that wait
            trust_env=False,
        ) as http:
            yield _Ask(process, http)
    finally:
        process.stop()


if __name__ == "__main__":
    for measured in measure():
        print(measured)  # noqa: T201
