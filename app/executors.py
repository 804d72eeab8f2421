"""Worker processes on this machine, for work that takes more than one core."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from multiprocessing import forkserver, get_context, parent_process, resource_tracker
from multiprocessing.connection import wait
from multiprocessing.context import BaseContext
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
        imports: modules that the jobs need; on Linux they are imported once, not by each worker.
    """

    def __init__(self, workers: int | None = None, imports: Sequence[str] = ()) -> None:
        self.workers = workers or usable_cores()
        self.description = f"{self.workers} process{'es' if self.workers > 1 else ''} on this machine"
        self._lock = threading.Lock()
        self._context = _context(imports)
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
        return ProcessPoolExecutor(self.workers, self._context, initializer=_prepare_worker)


def call(executor: Executor, job: Callable[..., Result], /, *arguments: object) -> Result:
    """Return the job's result; try once more if its process, which others share, died."""
    try:
        return executor.submit(job, *arguments).result()
    except BrokenExecutor:
        return executor.submit(job, *arguments).result()


def usable_cores() -> int:
    """The cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _context(imports: Sequence[str]) -> BaseContext:
    """How workers are started: never forked from this process, whose OpenGL contexts and locks would not survive it.

    On Linux they are forked from a process that has done nothing but import, which takes three seconds of a core. It
    begins at once, stays for later executors of this process, whose further modules their workers import themselves,
    and ends with it. Elsewhere system libraries do not survive a fork, and each worker imports for itself.
    """
    if sys.platform != "linux":
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload(["__main__", *imports])
    resource_tracker.ensure_running()  # otherwise started below, where it would let Ctrl-C through again
    unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited: Ctrl-C is for the parent
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
    return context


def _prepare_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent to handle
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for work forever."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
