"""Archives: a task's settings and uploaded episodes in one zip file, which another service can import.

It has `task.json` (the settings), `episodes/000000/` (`metadata.json`, `trajectory.npz`, and images named as in the
upload), and `manifest.json` with the SHA-256 of each. The same task gives the same bytes.
"""

import hashlib
import json
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from app.datasets.bounds import Budget, DamagedError, DatasetError, in_one_step
from app.datasets.options import ImportOptions
from app.datasets.parcel import Dataset, Entry, Parcel, canonical_json, checked_metadata
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.names import checked_name

FORMAT, VERSION = "roboprompt-task", 1
MANIFEST, TASK, METADATA, TRAJECTORY = "manifest.json", "task.json", "metadata.json", "trajectory.npz"
_EPOCH = (1980, 1, 1, 0, 0, 0)  # zip's first day: the time of writing would change the bytes


def looks_like(path: Path) -> bool:
    """Return whether the file is a zip."""
    return path.is_file() and zipfile.is_zipfile(path)


def write_archive(target: Path, task: str, settings: Mapping[str, Any], parcels: Iterable[Parcel]) -> int:
    """Write the task and return the number of episodes; raises DatasetError if the file exists or is not writable."""
    digests: dict[str, str] = {}
    number = 0
    with in_one_step(target) as unfinished, zipfile.ZipFile(unfinished, "w") as archive:

        def add(name: str, data: bytes) -> None:
            digests[name] = hashlib.sha256(data).hexdigest()
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), data)

        add(TASK, canonical_json(settings))
        for number, parcel in enumerate(parcels, 1):
            folder = f"episodes/{number - 1:06d}"
            add(f"{folder}/{METADATA}", canonical_json(parcel.metadata))
            for part, data in sorted(parcel.files.items()):
                add(f"{folder}/{TRAJECTORY if part == 'trajectory' else part}", data)
        manifest = {"format": FORMAT, "version": VERSION, "task": task, "files": digests}
        archive.writestr(zipfile.ZipInfo(MANIFEST, _EPOCH), canonical_json(manifest))
    return number


def open_archive(path: Path, options: ImportOptions) -> Dataset:
    """Return the episodes and the task's settings; raises DatasetError if it is another file, or damaged."""
    budget = Budget(path, options.max_unpacked_bytes)
    try:
        archive = zipfile.ZipFile(path)  # stays open while the dataset is read
        task, digests = _manifest(archive, budget)
    except (OSError, zipfile.BadZipFile, KeyError, TypeError, ValueError) as error:
        raise DatasetError(f"{path}: is no archive of a task: {error}") from error
    named = checked_name("task", options.task or task)
    settings = json.loads(_read(archive, TASK, digests, budget))
    if not isinstance(settings, dict) or "task" in settings:
        raise DatasetError(f"{path}: {TASK} holds no task's settings")
    folders: dict[str, list[str]] = {}
    for name in digests:
        if name.startswith("episodes/"):
            folders.setdefault(name.rpartition("/")[0], []).append(name)
    there, entries, damaged = set(archive.namelist()), [], []
    for folder in sorted(folders):
        if absent := [name for name in folders[folder] if name not in there]:
            damaged.append(f"{folder}: {absent[0]} is not in the archive")
        else:
            entries.append(Entry(folder, partial(_parcel, archive, folders[folder], digests, task, options)))
    return Dataset("RoboPrompt archive", tuple(entries), {named: settings}, tuple(damaged))


def _manifest(archive: zipfile.ZipFile, budget: Budget) -> tuple[str, dict[str, Any]]:
    """Return the task's name, and the SHA-256 of every other member by name."""
    manifest = json.loads(_unpacked(archive, MANIFEST, budget))
    if (manifest["format"], manifest["version"]) != (FORMAT, VERSION):
        raise ValueError(f"is {manifest['format']} {manifest['version']}, expected {FORMAT} {VERSION}")
    return str(manifest["task"]), dict(manifest["files"])


def _parcel(
    archive: zipfile.ZipFile, names: list[str], digests: Mapping[str, str], task: str, options: ImportOptions
) -> Parcel:
    where = f"{archive.filename}: {names[0].rpartition('/')[0]}"
    # The sum is checked before the first member is unpacked.
    Budget(where, options.max_unpacked_bytes).take(sum(archive.getinfo(name).file_size for name in names))
    budget = Budget(where, options.max_unpacked_bytes)
    files = {name.rpartition("/")[2]: _read(archive, name, digests, budget) for name in names}
    try:
        metadata = checked_metadata(where, json.loads(files.pop(METADATA)))
        parts = {"trajectory": files.pop(TRAJECTORY), **files}
    except (KeyError, ValueError) as error:
        raise DamagedError(names[0], f"the episode is not complete: {error}") from error
    if options.task is None and metadata["task"] != task:
        mismatch = f"the episode is of task {metadata['task']!r}, the archive of task {task!r}"
        raise InvalidInputError("task", mismatch, "one task in both, or --task NAME for every episode")
    return Parcel({**metadata, **options.given}, parts)


def _read(archive: zipfile.ZipFile, name: str, digests: Mapping[str, str], budget: Budget) -> bytes:
    where = f"{archive.filename}: {name}"
    try:
        data = _unpacked(archive, name, budget)
    except (OSError, zipfile.BadZipFile, zlib.error, KeyError, EOFError, RuntimeError) as error:
        raise DamagedError(where, error) from error
    if hashlib.sha256(data).hexdigest() != digests.get(name):
        raise DamagedError(where, "does not match its SHA-256 in the manifest")
    return data


def _unpacked(archive: zipfile.ZipFile, name: str, budget: Budget) -> bytes:
    """Return the member's bytes, at most as many as its header says."""
    member = archive.getinfo(name)
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):  # the others take any memory
        raise DamagedError(f"{archive.filename}: {name}", "is neither stored nor deflated")
    budget.take(member.file_size, f"{archive.filename}: {name}")
    with archive.open(member) as file:
        return file.read(member.file_size + 1)[: member.file_size]
