"""Send a dataset's episodes to a service, one after the other."""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Literal

from app.client.client import RoboPromptClient
from app.client.errors import ServiceProblemError
from app.datasets.bounds import DamagedError
from app.datasets.recording import Dataset, Entry, Parcel, canonical_json
from app.pipeline.errors import InvalidInputError
from app.pipeline.keyframes import KeyframeRule, find_keyframes
from app.pipeline.trajectory_npz import trajectory_from_npz

Status = Literal["imported", "already_there", "damaged", "refused"]
READERS = 2  # threads that read ahead of the upload
AHEAD = 4  # episodes that wait in memory at most
_MEDIA_TYPE = "application/octet-stream"


@dataclass(frozen=True)
class Result:
    """What became of one episode.

    Attributes:
        detail: the reason, where it was not imported.
        notes: what the dataset lacked without being refused for it.
        keyframes: by the service's rule, in a dry run by the default one.
    """

    name: str
    status: Status
    detail: str = ""
    notes: tuple[str, ...] = ()
    frames: int = 0
    keyframes: int = 0
    task: str = ""


def import_dataset(dataset: Dataset, client: RoboPromptClient) -> Iterator[Result]:
    """Upload every episode in its order; damaged and refused ones are skipped.

    Raises:
        ServiceUnreachableError: in the middle, if the service goes away; what was sent stays.
    """
    return _each(dataset, lambda entry, parcel: _send(client, entry, parcel))


def check_dataset(dataset: Dataset) -> Iterator[Result]:
    """What an import would do, as far as it is known without the service."""
    return _each(dataset, _check)


def prepare_tasks(dataset: Dataset, client: RoboPromptClient) -> list[str]:
    """Create the tasks whose settings the dataset brings; returns what the user should know.

    Raises:
        ServiceProblemError, ServiceUnreachableError.
    """
    notes = []
    for name, settings in dataset.task_settings.items():
        try:
            there = client.get(f"/tasks/{name}")
        except ServiceProblemError as error:
            if error.status != 404:
                raise
            client.configure_task(name, **settings)
            continue
        differing = [key for key, value in settings.items() if canonical_json(there.get(key)) != canonical_json(value)]
        if differing:
            notes.append(f"task {name!r} exists with other settings, which stay: {', '.join(differing)}")
    return notes


def _each(dataset: Dataset, handle: Callable[[Entry, Parcel], Result]) -> Iterator[Result]:
    with ThreadPoolExecutor(READERS) as readers:
        waiting: deque[tuple[Entry, Future[Parcel]]] = deque()
        entries = iter(dataset.entries)
        try:
            while True:
                while len(waiting) < AHEAD and (entry := next(entries, None)) is not None:
                    waiting.append((entry, readers.submit(entry.read)))
                if not waiting:
                    return
                entry, reading = waiting.popleft()
                try:
                    yield handle(entry, reading.result())
                except DamagedError as error:
                    yield Result(entry.name, "damaged", str(error))
                except InvalidInputError as error:
                    yield Result(entry.name, "refused", str(error))
        finally:
            readers.shutdown(cancel_futures=True)


def _send(client: RoboPromptClient, entry: Entry, parcel: Parcel) -> Result:
    key = parcel.key
    task = str(parcel.metadata["task"])
    if not parcel.metadata["objects"]:
        return _without_objects(entry, task)
    try:
        if _is_there(client, key):
            return Result(entry.name, "already_there", notes=parcel.notes, task=task)
        metadata = ("metadata.json", canonical_json(parcel.metadata), "application/json")
        files = {name: (name, data, _MEDIA_TYPE) for name, data in parcel.files.items()}
        answer: dict[str, Any] = client.upload_parts({"metadata": metadata, **files}, key)
    except ServiceProblemError as error:
        return Result(entry.name, "refused", str(error), parcel.notes, task=task)
    counts = (answer["num_frames"], len(answer["keyframes"]))
    return Result(entry.name, "imported", "", parcel.notes, *counts, task)


def _is_there(client: RoboPromptClient, key: str) -> bool:
    try:
        client.get(f"/uploads/{key}")
    except ServiceProblemError as error:
        if error.status == 404:
            return False
        raise
    return True


def _check(entry: Entry, parcel: Parcel) -> Result:
    task, objects = str(parcel.metadata["task"]), parcel.metadata["objects"]
    if not objects:
        return _without_objects(entry, task)
    trajectory = trajectory_from_npz(parcel.files["trajectory"])
    keyframes = find_keyframes(trajectory, KeyframeRule(), float(parcel.metadata.get("control_frequency_hz", 20.0)))
    unknown = [item["name"] for item in objects if item.get("position") is None and not item.get("mask_ids")]
    notes = parcel.notes
    if unknown:
        notes += (
            f"no poses or mask ids of {', '.join(unknown)}: the task's object models must find them in the images",
        )
    return Result(entry.name, "imported", "", notes, len(trajectory), len(keyframes), task)


def _without_objects(entry: Entry, task: str) -> Result:
    reason = "the dataset names no objects: give their poses, mask ids or names with --objects FILE"
    return Result(entry.name, "refused", reason, task=task)
