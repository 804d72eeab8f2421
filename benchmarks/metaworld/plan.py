"""What a run consists of."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from benchmarks.metaworld.ledger import REPLAY


def is_llm(model: str) -> bool:
    """LLMs are named PROVIDER/MODEL; the yardsticks without an LLM have no provider."""
    return "/" in model


@dataclass(frozen=True)
class Plan:
    """What is run.

    Attributes:
        demos: wanted of each task; their scenes' seeds begin at `first_demo_seed`.
        tests: of each model without an LLM, and replays; unseen scenes' seeds begin at `first_test_seed`.
        llm_tests: of each LLM, the same scenes.
        models: names as `GET /models` has them.
        noise_m: standard deviation on each axis of observed positions.
        noise_on: whose.
        record_hz: rate of the recordings.
        settings: of each task, as `PUT /tasks` takes them; nothing leaves the service's defaults.
    """

    demos: int = 10
    tests: int = 5
    llm_tests: int = 5
    models: tuple[str, ...] = ("nearest", "regression", "embedded/gemma-3-270m")
    first_demo_seed: int = 0
    first_test_seed: int = 1000
    noise_m: float = 0.0
    noise_on: Literal["demos", "tests", "both"] = "tests"
    record_hz: int = 27
    settings: Mapping[str, Any] | None = None

    def conditions(self) -> dict[str, Any]:
        """What one file of results has in common."""
        names = ("demos", "first_demo_seed", "first_test_seed", "noise_m", "noise_on", "record_hz", "settings")
        return {name: getattr(self, name) for name in names}

    def seeds(self, method: str) -> range:
        """Of the trials; of replays the demonstrations' numbers."""
        if method == REPLAY:
            return range(min(self.tests, self.demos))
        return range(self.first_test_seed, self.first_test_seed + (self.llm_tests if is_llm(method) else self.tests))

    def noise(self, which: Literal["demos", "tests"]) -> float:
        """On the positions of demonstrations or tests."""
        return self.noise_m if self.noise_on in (which, "both") else 0.0
