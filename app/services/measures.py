"""Measurements of a request: milliseconds per stage, and Prometheus's counters."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest
from prometheus_client.exposition import CONTENT_TYPE_LATEST

MAX_MODELS = 50
OTHER_MODELS = "other"
STAGE_SECONDS = (0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60)


@dataclass(frozen=True)
class Timings:
    """The stages of one prediction.

    Attributes:
        ms: by stage, added up.
        started_s: when the first began, by `time.perf_counter`.
    """

    ms: dict[str, float] = field(default_factory=dict)
    started_s: float = field(default_factory=time.perf_counter)

    def reached(self, stage: str) -> float:
        """Note and return the milliseconds from the beginning to here, unless the stage was reached before."""
        return self.ms.setdefault(stage, (time.perf_counter() - self.started_s) * 1000)


_timings: ContextVar[Timings | None] = ContextVar("timings", default=None)


def timings() -> Timings:
    """Those of the prediction that is made here; elsewhere new ones, which are lost."""
    return _timings.get() or Timings()


@contextmanager
def timings_of_its_own() -> Iterator[Timings]:
    """Inside, stages are timed apart from those outside; also in the threads and tasks that the block starts."""
    token = _timings.set(own := Timings())
    try:
        yield own
    finally:
        _timings.reset(token)


@contextmanager
def timed(stage: str) -> Iterator[None]:
    """Add the duration of the block to the stage's, also when it raises."""
    current = timings()
    started_s = time.perf_counter()
    try:
        yield
    finally:
        current.ms[stage] = current.ms.get(stage, 0.0) + (time.perf_counter() - started_s) * 1000


class Metrics:
    """One process's figures: with several workers each has its own.

    Names of tasks are not labels: there may be any number of them. Of models, whose names come from requests, too, the
    first few have a label of their own, and the others share one.
    """

    content_type = CONTENT_TYPE_LATEST

    def __init__(self) -> None:
        self._registry = registry = CollectorRegistry()
        self._model_labels: set[str] = set()
        self._requests = Histogram(
            "roboprompt_http_request_seconds",
            "From the request's head to the answer's last byte",
            ("method", "route", "status"),
            buckets=STAGE_SECONDS,
            registry=registry,
        )
        self._predictions = Counter(
            "roboprompt_predictions",
            "Predictions by how they ended: ok, parse_error, unsafe_action, unsupported, model_error",
            ("model", "representation", "status"),
            registry=registry,
        )
        self._stages = Histogram(
            "roboprompt_prediction_stage_seconds",
            "Time of a prediction's stages: read, poses, prompt, llm, first_action, parse, write, total, outside_llm",
            ("model", "stage"),
            buckets=STAGE_SECONDS,
            registry=registry,
        )
        self._tokens = Counter(
            "roboprompt_llm_tokens",
            "Tokens of prompts (cached ones among them) and of replies",
            ("model", "kind"),
            registry=registry,
        )
        self._outcomes = Counter(
            "roboprompt_outcomes", "How robots fared, as they reported", ("model", "success"), registry=registry
        )

    def observe_request(self, method: str, route: str, status: int, seconds: float) -> None:
        """Note an answered request.

        Args:
            route: the path's template.
        """
        self._requests.labels(method, route, str(status)).observe(seconds)

    def observe_prediction(
        self,
        model: str,
        representation: str,
        status: str,
        timings_ms: Mapping[str, float],
        tokens: Mapping[str, int],
    ) -> None:
        model = self._label(model)
        self._predictions.labels(model, representation, status).inc()
        for stage, milliseconds in timings_ms.items():
            self._stages.labels(model, stage).observe(milliseconds / 1000)
        for kind, number in tokens.items():
            self._tokens.labels(model, kind).inc(number)

    def observe_outcome(self, model: str, *, success: bool) -> None:
        self._outcomes.labels(self._label(model), str(success).lower()).inc()

    def _label(self, model: str) -> str:
        if model not in self._model_labels and len(self._model_labels) >= MAX_MODELS:
            return OTHER_MODELS
        self._model_labels.add(model)
        return model

    def text(self) -> bytes:
        return generate_latest(self._registry)
