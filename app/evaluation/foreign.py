"""Worker processes of another Python environment, which run functions of modules that both environments have.

`python -m app.evaluation.foreign NUMBER` is such a process; NUMBER is an inherited file descriptor.
"""

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path

import app
import roboprompt_client
from app.executors import Result, usable_cores

FOLDERS = [str(Path(package.__path__[0]).parent) for package in (app, roboprompt_client)]
END_TIMEOUT_S = 10.0


class ForeignExecutor:
    """One process for each core. They end with this process, which closes its end of their pipes."""

    def __init__(self, python: Path) -> None:
        self.workers = usable_cores()
        self.description = f"{self.workers} process{'es' if self.workers > 1 else ''} of {python}"
        self._python = python
        self._threads = ThreadPoolExecutor(self.workers)
        self._local = threading.local()
        self._started: list[tuple[Connection, subprocess.Popen[bytes]]] = []

    def submit(self, job: Callable[..., Result], /, *arguments: object) -> Future[Result]:
        """Run a module-level function; arguments and result must be picklable."""
        return self._threads.submit(self._run, job, arguments)

    def close(self) -> None:
        """Drop waiting jobs, wait for running ones, and end the processes."""
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
                [self._python, "-m", __name__, str(theirs.fileno())],
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
