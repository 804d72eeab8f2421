"""Worker processes on this machine, in this Python environment or in another one.

`python -m app.executors NUMBER` is a worker of a `ForeignExecutor`; NUMBER is an inherited file descriptor.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import Pipe, forkserver, get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from pathlib import Path
from typing import Protocol, TypeVar

import app
import roboprompt_client

Result = TypeVar("Result")
FOLDERS = [str(Path(package.__path__[0]).parent) for package in (app, roboprompt_client)]
END_TIMEOUT_S = 10.0


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
        """Drop what has not begun, wait for what has, and free the workers."""
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
        with self._lock:
            try:
                return self._pool.submit(job, *arguments)
            except BrokenExecutor:
                self._pool = self._new_pool()
                return self._pool.submit(job, *arguments)

    def close(self) -> None:
        self._pool.shutdown(cancel_futures=True)

    def _new_pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.workers, self._context, initializer=_prepare_worker)


def call(executor: Executor, job: Callable[..., Result], /, *arguments: object) -> Result:
    """Return the job's result; try once more if its process, which others share, died."""
    try:
        return executor.submit(job, *arguments).result()
    except BrokenExecutor:
        return executor.submit(job, *arguments).result()


def timed(job: Callable[..., Result], /, *arguments: object) -> tuple[Result, float]:
    """Return the job's result and its duration in seconds. Runs in a worker."""
    started = time.perf_counter()
    return job(*arguments), time.perf_counter() - started


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


class ForeignExecutor:
    """One process of another Python environment for each core; both environments have the modules of the jobs.

    The processes end with this one, which closes its end of their pipes.
    """

    def __init__(self, python: Path) -> None:
        self.workers = usable_cores()
        self.description = f"{self.workers} process{'es' if self.workers > 1 else ''} of {python}"
        self._python = python
        self._threads = ThreadPoolExecutor(self.workers)
        self._local = threading.local()
        self._started: list[tuple[Connection, subprocess.Popen[bytes]]] = []

    def submit(self, job: Callable[..., Result], /, *arguments: object) -> Future[Result]:
        return self._threads.submit(self._run, job, arguments)

    def close(self) -> None:
        self._threads.shutdown(cancel_futures=True)
        for connection, process in self._started:
            connection.close()
            process.wait(END_TIMEOUT_S)

    def _run(self, job: Callable[..., Result], arguments: tuple[object, ...]) -> Result:
        connection: Connection = getattr(self._local, "connection", None) or self._start()
        try:
            connection.send((job, arguments))
            result, error = connection.recv()
        except (EOFError, OSError) as lost:
            del self._local.connection
            raise BrokenExecutor(f"a process of {self._python} ended") from lost
        if error is not None:
            raise error
        found: Result = result
        return found

    def _start(self) -> Connection:
        ours, theirs = Pipe()
        paths = [*FOLDERS, *filter(None, [os.environ.get("PYTHONPATH")])]
        with theirs:
            process = subprocess.Popen(
                [self._python, "-m", "app.executors", str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
                start_new_session=True,  # Ctrl-C is for this process to handle
            )
        self._started.append((ours, process))
        self._local.connection = ours
        return ours


def main() -> None:
    """Run the jobs from the pipe until it is closed."""
    with Connection(int(sys.argv[1])) as connection:
        while True:
            try:
                job, arguments = connection.recv()
            except EOFError:
                return
            answer: tuple[object, Exception | None]
            try:
                answer = job(*arguments), None
            except Exception as error:
                answer = None, error
            connection.send(answer)


if __name__ == "__main__":
    main()
