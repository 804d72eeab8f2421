"""What an attack does to a service: how long health checks wait, its memory, its CPU time."""

import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx

PAUSE_S = 0.01


@dataclass
class Toll:
    """What the service paid.

    Attributes:
        health_s: the waits of health checks, one after the other.
        grown_mb: by how much the most memory it ever used has grown.
        cpu_s: CPU time of all its threads.
    """

    health_s: list = field(default_factory=list)
    grown_mb: float = 0.0
    cpu_s: float = 0.0
    wall_s: float = 0.0

    @property
    def longest_s(self):
        return max(self.health_s)

    def __str__(self):
        return (
            f"{self.wall_s:.2f} s, CPU {self.cpu_s:.2f} s, memory +{self.grown_mb:.0f} MB, "
            f"/healthz at most {1000 * self.longest_s:.0f} ms"
        )


def peak_mb(process_id):
    """The most memory that the process has used."""
    status = Path(f"/proc/{process_id}/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1000


def cpu_s(process_id):
    """CPU time of a process so far, ended threads included."""
    fields = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100


@contextmanager
def watched(process_id, url):
    """Fills in what the block did to the service."""
    toll, ended = Toll(), threading.Event()
    Path(f"/proc/{process_id}/clear_refs").write_text("5")  # the peak begins again
    memory, cpu, begun = peak_mb(process_id), cpu_s(process_id), time.monotonic()
    asking = threading.Thread(target=_ask, args=(url, toll.health_s, ended))
    asking.start()
    try:
        yield toll
    finally:
        ended.set()
        asking.join()
        toll.grown_mb, toll.cpu_s = peak_mb(process_id) - memory, cpu_s(process_id) - cpu
        toll.wall_s = time.monotonic() - begun


def _ask(url, waits_s, ended):
    with httpx.Client(base_url=url, timeout=120) as http:
        while not (waits_s and ended.is_set()):
            begun = time.monotonic()
            http.get("/healthz")
            waits_s.append(time.monotonic() - begun)
            ended.wait(PAUSE_S)
