"""Detects the format of a dataset and reads it in a child process, within limits of memory and time.

Untrusted files are read by large C libraries (images, HDF5, Parquet, video, compressed chunks); a file that breaks one
of them only breaks a process without any secrets. The process answers in MessagePack, never with pickled objects. First
come the formats, then the parent's side, then `main` of the child.
"""

import json
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import msgpack

from app.datasets import archive, mcap_log, rlbench, robomimic
from app.datasets.bounds import MEGABYTE, REMEDY, DamagedError, DatasetError, ReadLimits
from app.datasets.lerobot import reader as lerobot
from app.datasets.options import ImportOptions
from app.datasets.parcel import Dataset, Entry, Parcel, canonical_json
from roboprompt_client.errors import InvalidInputError

# Python and its libraries need these; keys and addresses of services are not passed on.
KEPT_VARIABLES = ("PATH", "LANG", "LC_ALL", "LC_CTYPE", "TMPDIR", "TEMP", "SYSTEMROOT", "LD_LIBRARY_PATH")
# Libraries reserve address space for every core, which would count as memory.
FRUGAL = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MALLOC_ARENA_MAX": "2",
    "ARROW_DEFAULT_MEMORY_POOL": "system",
}
FRAMING_BYTES = 10 * MEGABYTE
MAX_QUESTION_BYTES = 100 * MEGABYTE  # the options include the objects of every episode
_STATM = Path("/proc/self/statm")


@dataclass(frozen=True)
class Format:
    """A format that can be imported.

    Attributes:
        looks_like: whether a file or folder may have this format; it reads as little as possible.
    """

    looks_like: Callable[[Path], bool]
    open: Callable[[Path, ImportOptions], Dataset]


FORMATS: dict[str, Format] = {
    "archive": Format(archive.looks_like, archive.open_archive),
    "lerobot": Format(lerobot.looks_like, lerobot.open_lerobot),
    "robomimic": Format(robomimic.looks_like, robomimic.open_robomimic),
    "mcap": Format(mcap_log.looks_like, mcap_log.open_mcap),
    "rlbench": Format(rlbench.looks_like, rlbench.open_rlbench),
}


def open_dataset(path: Path, options: ImportOptions, name: str | None = None) -> Dataset:
    """Return the dataset at `path`, of the named or detected format; raises DatasetError if there is none."""
    if not path.exists():
        raise DatasetError(f"{path} does not exist")
    if name is not None:
        dataset = FORMATS[name].open(path, options)
    elif (found := next((item for item in FORMATS.values() if item.looks_like(path)), None)) is not None:
        dataset = found.open(path, options)
    else:
        raise DatasetError(f"{path} is of no known format ({', '.join(FORMATS)}): see docs/datasets.md")
    if not dataset.entries and not dataset.damaged:
        raise DatasetError(f"{path}: no episodes of {dataset.format} in it")
    return dataset


@contextmanager
def open_apart(path: Path, options: ImportOptions, name: str | None = None) -> Iterator[Dataset]:
    """Like `open_dataset`, in a child process; raises DamagedError also if that ends, and another one takes over."""
    reader = _Reader(pickle.dumps((path, options, name)), options.limits)
    try:
        found = reader.ask({"open": True}, str(path))
        entries = (Entry(title, partial(_read, reader, k, title)) for k, title in enumerate(found["entries"]))
        settings = json.loads(found["task_settings"])
        yield Dataset(found["format"], tuple(entries), settings, tuple(found["damaged"]))
    finally:
        reader.close()


def _read(reader: "_Reader", index: int, title: str) -> Parcel:
    answer = reader.ask({"read": index}, title)
    return Parcel(json.loads(answer["metadata"]), dict(answer["files"]), tuple(answer["notes"]))


class _Reader:
    """The child process, started when it is asked, and again when it has ended. Threads take turns.

    Args:
        request: pickled, which only this process does: answers are never unpickled.
    """

    def __init__(self, request: bytes, limits: ReadLimits) -> None:
        self._request, self._limits = request, limits
        self._turn = threading.Lock()
        self._child: tuple[subprocess.Popen[bytes], Connection] | None = None

    def ask(self, question: dict[str, Any], title: str) -> dict[str, Any]:
        """Return the answer; raises the error that the process reports, and DamagedError if it ends or is too slow."""
        with self._turn:
            process, connection = self._child = self._child or _started(self._request)
            late = threading.Event()

            def give_up() -> None:
                late.set()
                process.kill()

            timer = threading.Timer(self._limits.seconds, give_up)
            timer.start()
            try:
                connection.send_bytes(msgpack.packb(question))
                answer = msgpack.unpackb(connection.recv_bytes(2 * self._limits.unpacked_bytes + FRAMING_BYTES))
            except (EOFError, OSError, ValueError):  # it has ended, or answers something else
                answer = None
            finally:
                timer.cancel()
            if not isinstance(answer, dict):
                self.close()
                limit = f"takes more than {self._limits.seconds:g} s to read"
                raise DamagedError(title, limit if late.is_set() else _cause(process.returncode))
        if "error" in answer:
            raise _error(*(_printable(str(item)) for item in answer["error"]))
        return answer

    def close(self) -> None:
        if self._child is not None:
            process, connection = self._child
            process.kill()
            process.wait()
            connection.close()
            self._child = None


def _started(request: bytes) -> tuple[subprocess.Popen[bytes], Connection]:
    ours, theirs = Pipe()
    with theirs:
        process = subprocess.Popen(
            # -P: a dataset's folder must not shadow the modules that are imported
            [sys.executable, "-P", "-m", "app.datasets.apart", str(theirs.fileno())],
            stdin=subprocess.DEVNULL,
            stdout=2,  # what a library prints
            env=_environment(),
            pass_fds=[theirs.fileno()],
            start_new_session=True,  # Ctrl-C is for the parent to handle
        )
    with suppress(OSError):  # it has ended already, as its first answer shows
        ours.send_bytes(request)
    return process, ours


def _environment() -> dict[str, str]:
    kept = {name: os.environ[name] for name in KEPT_VARIABLES if name in os.environ}
    return {**kept, **FRUGAL, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def _cause(status: int) -> str:
    how = signal.Signals(-status).name if status < 0 else f"status {status}"
    return f"its reader ended with {how}: the file is damaged, or made to do harm"


def _printable(text: str) -> str:
    """Return `text` with control characters escaped."""
    return "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in text)


def _error(kind: str, *arguments: str) -> Exception:
    match kind:
        case "invalid":
            field, message, valid = arguments
            return InvalidInputError(field, message, valid or None)
        case "dataset":
            return DatasetError(*arguments)
    return DamagedError(*arguments)


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
            dataset = dataset or open_dataset(path, options, name)
            answer = _listed(dataset) if "open" in question else _packed(dataset.entries[question["read"]].read())
        except Exception as error:  # whatever a library raises over such a file
            answer = {"error": _reported(error, path)}
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


def _reported(error: Exception, path: Path) -> list[str]:
    match error:
        case InvalidInputError():
            return ["invalid", error.field, error.message, error.valid or ""]
        case DamagedError():
            return ["damaged", error.file, error.reason]
        case DatasetError():
            return ["dataset", str(error)]
        case MemoryError():
            return ["damaged", str(path), f"needs more memory than an episode may take: {REMEDY}"]
    return ["damaged", str(path), f"cannot be read: {type(error).__name__}: {error!s:.300}"]


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
