"""Reads datasets in child processes, within limits of memory and time.

Untrusted files are read by large C libraries; a file that breaks one of them only breaks a process without any secrets.
The processes answer in MessagePack, never with pickled objects. First comes the parent's side, then `main` of a child.
"""

import json
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import msgpack

from app.datasets.bounds import MEGABYTE, REMEDY, DamagedError, DatasetError, MissingPackageError, ReadLimits
from app.datasets.formats import open_dataset
from app.datasets.options import ImportOptions
from app.datasets.parcel import Dataset, Entry, Parcel, canonical_json
from roboprompt_client.errors import InvalidInputError

# Python and its libraries need these; keys and addresses of services are not passed on.
KEPT_VARIABLES = ("PATH", "LANG", "LC_ALL", "LC_CTYPE", "TMPDIR", "TEMP", "SYSTEMROOT", "LD_LIBRARY_PATH")
# Libraries reserve address space for every core, which would count as memory.
FRUGAL = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}
FRAMING_BYTES = 10 * MEGABYTE
MAX_QUESTION_BYTES = 100 * MEGABYTE  # the options include the objects of every episode
_STATM = Path("/proc/self/statm")


@contextmanager
def open_apart(path: Path, options: ImportOptions, name: str | None = None) -> Iterator[Dataset]:
    """Like `open_dataset`, in one child process per reading thread; raises DatasetError also if one dies."""
    readers = _Readers(path, options, name)
    try:
        with readers.one() as reader:
            found = reader.ask({"open": True}, str(path))
        entries = (Entry(title, partial(readers.read, k, title)) for k, title in enumerate(found["entries"]))
        settings = json.loads(found["task_settings"])
        yield Dataset(found["format"], tuple(entries), settings, tuple(found["damaged"]))
    finally:
        readers.close()


class _Readers:
    """Child processes that have the same dataset open; each serves one thread at a time."""

    def __init__(self, path: Path, options: ImportOptions, name: str | None) -> None:
        self._limits = options.limits
        # Only what this process sends is pickled; answers are never unpickled.
        self._request = pickle.dumps((path, options, name))
        self._idle: SimpleQueue[_Reader] = SimpleQueue()

    def read(self, index: int, title: str) -> Parcel:
        """Return an episode; raises its entry's errors, and DamagedError if the process dies."""
        with self.one() as reader:
            answer = reader.ask({"read": index}, title)
        return Parcel(json.loads(answer["metadata"]), dict(answer["files"]), tuple(answer["notes"]))

    @contextmanager
    def one(self) -> Iterator["_Reader"]:
        """Yield a process for the caller alone."""
        try:
            reader = self._idle.get_nowait()
        except Empty:
            reader = _Reader(self._request, self._limits)
        try:
            yield reader
        finally:
            if reader.alive:
                self._idle.put(reader)

    def close(self) -> None:
        """End the processes."""
        while not self._idle.empty():
            self._idle.get().close()


class _Reader:
    """A child process."""

    def __init__(self, request: bytes, limits: ReadLimits) -> None:
        self._limits = limits
        self._connection, theirs = Pipe()
        with theirs:
            self._process = subprocess.Popen(
                # -P: a dataset's folder must not shadow the modules that are imported
                [sys.executable, "-P", "-m", "app.datasets.apart", str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=2,  # what a library prints
                env=_environment(),
                pass_fds=[theirs.fileno()],
                start_new_session=True,  # Ctrl-C is for the parent to handle
            )
        self.alive = True
        self._send(request)

    def ask(self, question: dict[str, Any], title: str) -> dict[str, Any]:
        """Return the answer; raises the error that the process reports, and DamagedError if it dies or is too slow."""
        late = threading.Event()

        def give_up() -> None:
            late.set()
            self._process.kill()

        timer = threading.Timer(self._limits.seconds, give_up)
        timer.start()
        try:
            answer = self._receive() if self._send(msgpack.packb(question)) else None
        finally:
            timer.cancel()
        if answer is None:
            self.close()
            limit = f"takes more than {self._limits.seconds:g} s to read"
            raise DamagedError(title, limit if late.is_set() else self._cause())
        if (kind := answer.get("error")) is not None:
            raise _error(kind, [_printable(str(item)) for item in answer["arguments"]])
        return answer

    def close(self) -> None:
        """Kill the process."""
        self.alive = False
        self._process.kill()
        self._process.wait()
        self._connection.close()

    def _cause(self) -> str:
        status = self._process.returncode
        how = signal.Signals(-status).name if status < 0 else f"status {status}"
        return f"its reader ended with {how}: the file is damaged, or made to do harm"

    def _send(self, message: bytes) -> bool:
        """Return whether the process is still there."""
        try:
            self._connection.send_bytes(message)
        except OSError:
            return False
        return True

    def _receive(self) -> dict[str, Any] | None:
        """Return an answer; None if the process has ended, or for any other message."""
        try:
            answer = msgpack.unpackb(self._connection.recv_bytes(2 * self._limits.unpacked_bytes + FRAMING_BYTES))
        except (EOFError, OSError, ValueError):
            return None
        return answer if isinstance(answer, dict) else None


def _environment() -> dict[str, str]:
    kept = {name: os.environ[name] for name in KEPT_VARIABLES if name in os.environ}
    pool = {"ARROW_DEFAULT_MEMORY_POOL": "system"}
    return {**kept, **FRUGAL, **pool, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def _printable(text: str) -> str:
    """Return `text` with control characters escaped."""
    return "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in text)


def _error(kind: str, arguments: list[str]) -> Exception:
    """Return the error that a process reports."""
    if kind == "InvalidInputError":
        field, message, valid = arguments
        return InvalidInputError(field, message, valid or None)
    if kind == "MemoryError":
        return DamagedError(arguments[0], f"needs more memory than an episode may take: {REMEDY}")
    kinds = {"MissingPackageError": MissingPackageError, "DatasetError": DatasetError}
    type_: type[DatasetError] = kinds.get(kind, DamagedError)
    error = type_.__new__(type_)
    error.args = (arguments[0],)  # its text is complete
    return error


def main() -> None:
    """Answer questions until the parent closes the pipe."""
    connection = Connection(int(sys.argv[1]))
    path, options, name = pickle.loads(connection.recv_bytes(MAX_QUESTION_BYTES))  # noqa: S301  # from our parent
    _limit_memory(options.limits)
    dataset: Dataset | None = None
    while True:
        try:
            question = msgpack.unpackb(connection.recv_bytes(MAX_QUESTION_BYTES))
        except EOFError:
            return
        try:
            dataset = open_dataset(path, options, name) if dataset is None else dataset
            answer = _listed(dataset) if "open" in question else _packed(dataset.entries[question["read"]].read())
        except Exception as error:  # whatever a library raises over such a file
            answer = _reported(error, path)
        connection.send_bytes(msgpack.packb(answer))


def _listed(dataset: Dataset) -> dict[str, Any]:
    return {
        "format": dataset.format,
        "entries": [entry.name for entry in dataset.entries],
        "task_settings": canonical_json(dataset.task_settings),
        "damaged": list(dataset.damaged),
    }


def _packed(parcel: Parcel) -> dict[str, Any]:
    return {"metadata": canonical_json(parcel.metadata), "files": dict(parcel.files), "notes": list(parcel.notes)}


def _reported(error: Exception, path: Path) -> dict[str, Any]:
    """Return the error's kind and arguments."""
    match error:
        case InvalidInputError():
            return {"error": "InvalidInputError", "arguments": [error.field, error.message, error.valid or ""]}
        case MissingPackageError() | DamagedError() | DatasetError():
            return {"error": type(error).__name__, "arguments": [str(error)]}
        case MemoryError():
            return {"error": "MemoryError", "arguments": [str(path)]}
    return {"error": "DamagedError", "arguments": [f"{path}: cannot be read: {type(error).__name__}: {error!s:.300}"]}


def _limit_memory(limits: ReadLimits) -> None:
    """Limit the address space if the system can; otherwise only budgets and the time limit apply."""
    try:
        import resource

        used = int(_STATM.read_text().split()[0]) * resource.getpagesize() if _STATM.exists() else 0
        allowed = used + limits.memory_bytes
        resource.setrlimit(resource.RLIMIT_AS, (allowed, allowed))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (ImportError, OSError, ValueError):
        return


if __name__ == "__main__":
    main()
