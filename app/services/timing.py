"""Milliseconds per stage of a request."""

import time
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager

Timings = MutableMapping[str, float]


@contextmanager
def timed(timings_ms: Timings, stage: str) -> Iterator[None]:
    """Add the duration of the block to `timings_ms[stage]`, also when it raises."""
    started = time.perf_counter()
    try:
        yield
    finally:
        timings_ms[stage] = timings_ms.get(stage, 0.0) + (time.perf_counter() - started) * 1000
