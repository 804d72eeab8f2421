"""Where simulations run: the seam, and processes on this machine. Ray is in `app.evaluation.ray_executor`."""

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from typing import Protocol, TypeVar

Result = TypeVar("Result")


class Executor(Protocol):
    """Runs functions elsewhere.

    Attributes:
        workers: how many functions run at once.
        description: for the record of a run.
    """

    workers: int
    description: str

    def submit(self, job: Callable[..., Result], /, *arguments: object) -> Future[Result]:
        """Run a module's function; arguments and result can be pickled."""
        ...

    def close(self) -> None:
        """Drop what has not begun and free the workers."""
        ...


class LocalExecutor:
    """Processes on this machine. A pool whose worker died is replaced.

    Args:
        workers: None: one for each core that this process may use.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or usable_cores()
        self.description = f"{self.workers} process{'es' if self.workers > 1 else ''} on this machine"
        self._lock = threading.Lock()
        self._pool = self._new_pool()

    def submit(self, job: Callable[..., Result], /, *arguments: object) -> Future[Result]:
        """Run a module's function in a process; arguments and result can be pickled."""
        with self._lock:
            try:
                return self._pool.submit(job, *arguments)
            except BrokenExecutor:
                self._pool = self._new_pool()
                return self._pool.submit(job, *arguments)

    def close(self) -> None:
        """Drop what has not begun, wait for what has."""
        self._pool.shutdown(cancel_futures=True)

    def _new_pool(self) -> ProcessPoolExecutor:
        # Workers are spawned, not forked: OpenGL contexts and locks do not survive a fork.
        return ProcessPoolExecutor(self.workers, get_context("spawn"), initializer=_prepare_worker)


def call(executor: Executor, job: Callable[..., Result], /, *arguments: object) -> Result:
    """The job's result. One that died with its process, which others share, gets a second chance."""
    try:
        return executor.submit(job, *arguments).result()
    except BrokenExecutor:
        return executor.submit(job, *arguments).result()


def usable_cores() -> int:
    """The cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _prepare_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent to handle
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for work forever."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
