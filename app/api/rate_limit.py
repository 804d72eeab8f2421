"""How often one caller may ask: a token bucket per key, or per address where there is no key."""

import time
from collections import OrderedDict

MAX_CALLERS = 10_000  # who has not been heard of for longest is forgotten, and starts with a full bucket


class RateLimit:
    """Token buckets of one process: with several workers each has its own.

    Args:
        requests_per_s: in the long run; 0: as many as anybody likes.
        burst: at once.
    """

    def __init__(self, requests_per_s: float, burst: int) -> None:
        self._rate = requests_per_s
        self._burst = burst
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait_s(self, caller: str) -> float:
        """Take a token; 0 if there was one, else how long until there is."""
        if not self._rate:
            return 0.0
        now = time.monotonic()
        tokens, since = self._buckets.pop(caller, (float(self._burst), now))
        tokens = min(self._burst, tokens + (now - since) * self._rate)
        allowed = tokens >= 1
        self._buckets[caller] = (tokens - 1 if allowed else tokens, now)
        if len(self._buckets) > MAX_CALLERS:
            self._buckets.popitem(last=False)
        return 0.0 if allowed else (1 - tokens) / self._rate
