"""`roboprompt import`: episodes that other tools recorded, sent to the service one after the other."""

import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.console import Console

from app.cli.shared import INTERRUPTED, AsJson, Url, counted, errors_printed, if_there
from app.datasets.bounds import MAX_UNPACKED_BYTES, MEGABYTE, DamagedError, DatasetError
from app.datasets.formats import open_dataset
from app.datasets.options import ImportOptions, KnownObjects, read_mapping, read_objects
from app.datasets.parcel import Dataset, Entry, Parcel, canonical_json
from app.pipeline.keyframes import KeyframeRule, Motion, find_keyframes
from app.untrusted_arrays import trajectory_from_npz
from roboprompt_client.client import DEFAULT_URL, RoboPromptClient
from roboprompt_client.errors import InvalidInputError, RoboPromptError, ServiceProblemError, ServiceUnreachableError

Status = Literal["imported", "already_there", "damaged", "refused"]
_MEDIA_TYPE = "application/octet-stream"
MAX_SHOWN = 10  # reasons on the terminal; --json has all


@dataclass(frozen=True)
class ImportResult:
    """The outcome of one episode.

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


def import_dataset(dataset: Dataset, client: RoboPromptClient) -> Iterator[ImportResult]:
    """Upload every episode in its order; damaged and refused ones are skipped.

    Raises:
        ServiceUnreachableError: in the middle, if the service goes away; what was sent stays.
    """
    return (_outcome(entry, partial(_send, client)) for entry in dataset.entries)


def check_dataset(dataset: Dataset) -> Iterator[ImportResult]:
    """Yield the outcomes of an import, as far as they are known without the service."""
    return (_outcome(entry, _check) for entry in dataset.entries)


def prepare_tasks(dataset: Dataset, client: RoboPromptClient) -> list[str]:
    """Create the tasks whose settings the dataset brings; returns what the user should know.

    Raises:
        ServiceProblemError, ServiceUnreachableError.
    """
    notes = []
    for name, settings in dataset.task_settings.items():
        there = if_there(partial(client.get, f"/tasks/{name}"))
        if there is None:
            client.configure_task(name, **settings)
            continue
        differing = [key for key, value in settings.items() if canonical_json(there.get(key)) != canonical_json(value)]
        if differing:
            notes.append(f"task {name!r} exists with other settings, which stay: {', '.join(differing)}")
    return notes


def _outcome(entry: Entry, handle: Callable[[str, Parcel], ImportResult]) -> ImportResult:
    try:
        parcel = _read(entry)
        if not parcel.metadata["objects"]:
            reason = "the dataset names no objects: give their poses, mask ids or names with --objects FILE"
            return ImportResult(entry.name, "refused", reason, task=str(parcel.metadata["task"]))
        return handle(entry.name, parcel)
    except DamagedError as error:
        return ImportResult(entry.name, "damaged", str(error))
    except InvalidInputError as error:
        return ImportResult(entry.name, "refused", str(error))


def _read(entry: Entry) -> Parcel:
    try:
        return entry.read()
    except RoboPromptError:
        raise
    except Exception as error:  # whatever a library raises over such a file
        raise DamagedError(entry.name, f"cannot be read: {type(error).__name__}: {error!s:.300}") from error


def _send(client: RoboPromptClient, name: str, parcel: Parcel) -> ImportResult:
    task, key = str(parcel.metadata["task"]), parcel.key
    try:
        if client.get("/episodes", upload_key=key)["episodes"]:
            return ImportResult(name, "already_there", notes=parcel.notes, task=task)
        metadata = ("metadata.json", canonical_json(parcel.metadata), "application/json")
        files = {part: (part, data, _MEDIA_TYPE) for part, data in parcel.files.items()}
        answer: dict[str, Any] = client.upload_parts({"metadata": metadata, **files}, key)
    except ServiceProblemError as error:
        return ImportResult(name, "refused", str(error), parcel.notes, task=task)
    counts = (answer["num_frames"], len(answer["keyframes"]))
    return ImportResult(name, "imported", "", parcel.notes, *counts, task)


def _check(name: str, parcel: Parcel) -> ImportResult:
    task, objects, notes = str(parcel.metadata["task"]), parcel.metadata["objects"], parcel.notes
    trajectory = trajectory_from_npz(parcel.files["trajectory"])
    motion = Motion.of(trajectory, float(parcel.metadata.get("control_frequency_hz", 20.0)))
    keyframes = find_keyframes(motion, KeyframeRule())
    unknown = [item["name"] for item in objects if item.get("position") is None and not item.get("mask_ids")]
    if unknown:
        missing = f"no poses or mask ids of {', '.join(unknown)}"
        notes += (f"{missing}: the task's object models must find them in the images",)
    return ImportResult(name, "imported", "", notes, len(trajectory), len(keyframes), task)


def import_data(
    path: Annotated[Path, typer.Argument(help="folder or file; its format is detected")],
    url: Url = DEFAULT_URL,
    task: Annotated[str | None, typer.Option(help="instead of the task that the dataset names")] = None,
    instruction: Annotated[str | None, typer.Option(help="instead of the dataset's")] = None,
    objects: Annotated[Path | None, typer.Option(help="JSON: names, mask ids or poses, see docs/datasets.md")] = None,
    mapping: Annotated[Path | None, typer.Option(help="JSON: which columns are what, see docs/datasets.md")] = None,
    max_unpacked_mb: Annotated[
        float, typer.Option(min=1, help="what the files of an episode may unpack to")
    ] = MAX_UNPACKED_BYTES / MEGABYTE,
    dry_run: Annotated[bool, typer.Option(help="say what would be imported and what is missing")] = False,
    as_json: AsJson = False,
) -> None:
    """Import a dataset. Episodes that are there already are skipped: the same command again continues where it stopped.

    A damaged file is named and skipped; the exit status is 1 if anything could not be imported.
    """
    console = Console(stderr=as_json)
    with errors_printed():
        known = KnownObjects() if objects is None else read_objects(objects)
        features = {} if mapping is None else read_mapping(mapping)
        limit_bytes = int(max_unpacked_mb * MEGABYTE)
        dataset = open_dataset(path, ImportOptions(task, instruction, known, features, limit_bytes))
        summary = _import(dataset, None if dry_run else url, console)
    _report(console, summary)
    if as_json:
        print(json.dumps(summary))  # noqa: T201
    if summary["stopped"] == "interrupted":
        raise typer.Exit(INTERRUPTED)
    if summary["stopped"] or summary["damaged"] or summary["refused"]:
        raise typer.Exit(1)


def _import(dataset: Dataset, url: str | None, console: Console) -> dict[str, Any]:
    """Return the outcome of each episode; `extend` keeps those before an interruption."""
    results: list[ImportResult] = []
    stopped: str | None = None
    total = len(dataset.entries)
    try:
        if url is None:
            results.extend(counted(check_dataset(dataset), total, "reading", console))
        else:
            with RoboPromptClient(url) as client:
                client.ping()
                for note in prepare_tasks(dataset, client):
                    console.print(note, markup=False, soft_wrap=True)
                results.extend(counted(import_dataset(dataset, client), total, "importing", console))
    except (DatasetError, ServiceUnreachableError, ServiceProblemError) as error:
        stopped = str(error)
    except KeyboardInterrupt:
        stopped = "interrupted"
    return {"dry_run": url is None, **_summary(dataset, results), "stopped": stopped}


def _summary(dataset: Dataset, results: Sequence[ImportResult]) -> dict[str, Any]:
    def of(status: str) -> list[ImportResult]:
        return [item for item in results if item.status == status]

    def listed(status: str) -> list[dict[str, str]]:
        return [{"episode": item.name, "reason": item.detail} for item in of(status)]

    unlisted = [{"episode": message.partition(":")[0], "reason": message} for message in dataset.damaged]
    imported = of("imported")
    return {
        "format": dataset.format,
        "episodes": len(dataset.entries) + len(dataset.damaged),
        "imported": len(imported),
        "already_there": len(of("already_there")),
        "damaged": unlisted + listed("damaged"),
        "refused": listed("refused"),
        "missing": dict(Counter(note for item in results for note in item.notes)),
        "tasks": dict(Counter(item.task for item in results if item.status in ("imported", "already_there"))),
        "frames": sum(item.frames for item in imported),
        "keyframes": sum(item.keyframes for item in imported),
    }


def _report(console: Console, summary: dict[str, Any]) -> None:
    def say(line: str) -> None:
        console.print(line, markup=False, highlight=False, soft_wrap=True)

    for kind in ("damaged", "refused"):
        grouped: dict[str, list[str]] = {}
        for item in summary[kind]:
            grouped.setdefault(item["reason"], []).append(item["episode"])
        for reason, names in list(grouped.items())[:MAX_SHOWN]:
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            say(f"{kind}: {names[0]}{more}: {reason}")
        if len(grouped) > MAX_SHOWN:
            say(f"{kind}: more for {len(grouped) - MAX_SHOWN} other reasons, listed by --json")
    for note, number in summary["missing"].items():
        say(f"missing in {number}: {note}")
    verb = "would be imported" if summary["dry_run"] else "imported"
    tasks = ", ".join(f"{name} ({number})" for name, number in summary["tasks"].items()) or "none"
    size = f"{summary['frames']} frames, {summary['keyframes']} keyframes"
    say(
        f"{summary['format']}, {summary['episodes']} episodes: {summary['imported']} {verb} ({size}), "
        f"{summary['already_there']} already there, "
        f"{len(summary['damaged'])} damaged, {len(summary['refused'])} refused; tasks: {tasks}"
    )
    if summary["stopped"]:
        say(f"stopped: {summary['stopped']}; the same command goes on from here")
