"""Milliseconds per stage of a request."""

import time
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager
from typing import Any, Protocol

Timings = MutableMapping[str, float]


class Tracer(Protocol):
    """OpenTelemetry's, as far as it is used; the package is not needed otherwise."""

    def start_span(self, name: str) -> Any: ...  # noqa: ANN401


_tracer: Tracer | None = None


def trace_with(tracer: Tracer | None) -> None:
    """Make a span of every stage from now on, in this process."""
    global _tracer
    _tracer = tracer


@contextmanager
def timed(timings_ms: Timings, stage: str) -> Iterator[None]:
    """Add the duration of the block to `timings_ms[stage]`, also when it raises."""
    started = time.perf_counter()
    # not made the current span: a stage may begin and end in different contexts of an asynchronous generator
    span = None if _tracer is None else _tracer.start_span(stage)
    try:
        yield
    finally:
        if span is not None:
            span.end()
        timings_ms[stage] = timings_ms.get(stage, 0.0) + (time.perf_counter() - started) * 1000
