"""Servers in processes of their own, and the CPU time that they take."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from app.evaluation.server import running

ROUNDS = 4
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Server:
    """A server that runs.

    Attributes:
        url: where it listens.
        pid: of its process.
    """

    url: str
    pid: int

    def cpu_s(self) -> float:
        """CPU time, user and system, of all its threads until now, without its children; in steps of 10 ms."""
        fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S


@dataclass(frozen=True)
class Cost:
    """Of one request, in milliseconds.

    Attributes:
        cpu_ms: of the server's process, all threads; the mean of the best of some rounds, as noise only adds.
        wall_ms: as the client sees it, median.
    """

    cpu_ms: float
    wall_ms: float


def cost(server: Server, send: Callable[[int], object], num_requests: int) -> Cost:
    """The cost of one of `num_requests` in `ROUNDS` rounds, after a tenth as many to warm up.

    Args:
        send: the request of that number, and its answer.
    """
    for k in range(num_requests // 10):
        send(k)
    walls_s: list[float] = []
    cpus_s: list[float] = []
    for round_ in range(ROUNDS):
        numbers = range(round_, num_requests, ROUNDS)
        before_s = server.cpu_s()
        for k in numbers:
            started_s = time.perf_counter()
            send(k)
            walls_s.append(time.perf_counter() - started_s)
        cpus_s.append((server.cpu_s() - before_s) / len(numbers))
    return Cost(1000 * min(cpus_s), 1000 * median(walls_s))


@contextmanager
def service(data: Path, **settings: str) -> Iterator[Server]:
    """The service on the folder `data`.

    Args:
        settings: by their names in `app.settings`.
    """
    environment = {f"ROBOPROMPT_{name.upper()}": value for name, value in settings.items()}
    with running(["app.cli", "serve", "--data", str(data)], environment, data / "server.log") as (url, process):
        yield Server(url, process.pid)
