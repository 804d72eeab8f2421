"""The process that `app.datasets.apart` starts: opens one dataset, reads the episodes that it is asked for."""

import os
import pickle
import sys
from pathlib import Path
from typing import Any

from app.datasets.apart import read_bytes, read_frame, write_frame
from app.datasets.bounds import MEGABYTE, DamagedError, DatasetError, MissingPackageError, ReadLimits
from app.datasets.formats import open_dataset
from app.datasets.parcel import Dataset, Parcel, canonical_json
from roboprompt_client.errors import InvalidInputError

MAX_QUESTION_BYTES = 100 * MEGABYTE  # the options hold what the user says of the objects of every episode
_STATM = Path("/proc/self/statm")


def main() -> None:
    """Answer until the other side closes."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a library prints is no answer
    path, options, name = pickle.loads(read_bytes(sys.stdin.buffer, MAX_QUESTION_BYTES))  # noqa: S301  # from our parent
    _limit_memory(options.limits)
    dataset: Dataset | None = None
    while True:
        try:
            question = read_frame(sys.stdin.buffer, MAX_QUESTION_BYTES)
        except EOFError:
            return
        try:
            dataset = open_dataset(path, options, name) if dataset is None else dataset
            answer = _listed(dataset) if "open" in question else _packed(dataset.entries[question["read"]].read())
        except Exception as error:  # whatever a library raises over such a file
            answer = _reported(error, path)
        write_frame(answers, answer)


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
    """The error's kind and arguments: objects are not sent."""
    match error:
        case InvalidInputError():
            return {"error": "InvalidInputError", "arguments": [error.field, error.message, error.valid or ""]}
        case MissingPackageError() | DamagedError() | DatasetError():
            return {"error": type(error).__name__, "arguments": [str(error)]}
        case MemoryError():
            return {"error": "MemoryError", "arguments": [str(path)]}
    return {"error": "DamagedError", "arguments": [f"{path}: cannot be read: {type(error).__name__}: {error!s:.300}"]}


def _limit_memory(limits: ReadLimits) -> None:
    """Bound the address space, where the system can; elsewhere budgets of bytes and the time limit remain."""
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
