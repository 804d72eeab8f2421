"""How long the phases of a run take."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

Phase = Literal["demonstrations_s", "trials_s", "report_s"]


@dataclass
class Timing:
    """Seconds on the clock."""

    demonstrations_s: float = 0.0
    trials_s: float = 0.0
    report_s: float = 0.0

    @contextmanager
    def measured(self, phase: Phase) -> Iterator[None]:
        """Note how long the block takes, however it ends."""
        started = time.perf_counter()
        try:
            yield
        finally:
            setattr(self, phase, time.perf_counter() - started)
