"""`roboprompt import`: episodes that other tools recorded, sent to the service one after the other."""

import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

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

MAX_SHOWN = 10  # episodes on the terminal that were not imported; --json has all
_MEDIA_TYPE = "application/octet-stream"


class ImportResult(NamedTuple):
    """The outcome of one episode.

    Attributes:
        detail: the reason, where it was not imported.
        notes: what the dataset lacked without being refused for it.
        keyframes: by the service's rule, in a dry run by the default one.
    """

    name: str
    status: Literal["imported", "already_there", "damaged", "refused"]
    detail: str = ""
    task: str = ""
    notes: tuple[str, ...] = ()
    keyframes: int = 0


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
        options = ImportOptions(task, instruction, known, features, int(max_unpacked_mb * MEGABYTE))
        summary = _import(open_dataset(path, options), None if dry_run else url, console)
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
                for note in _prepare_tasks(dataset, client):
                    console.print(note, markup=False, soft_wrap=True)
                sent = (_outcome(entry, partial(_send, client)) for entry in dataset.entries)
                results.extend(counted(sent, total, "importing", console))
    except (DatasetError, ServiceUnreachableError, ServiceProblemError) as error:
        stopped = str(error)
    except KeyboardInterrupt:
        stopped = "interrupted"
    return {"dry_run": url is None, **_summary(dataset, results), "stopped": stopped}


def check_dataset(dataset: Dataset) -> Iterator[ImportResult]:
    """Yield the outcomes of an import, as far as they are known without the service."""
    return (_outcome(entry, _check) for entry in dataset.entries)


def _prepare_tasks(dataset: Dataset, client: RoboPromptClient) -> Iterator[str]:
    """Create the tasks whose settings the dataset brings; yields what the user should know."""
    for name, settings in dataset.task_settings.items():
        there = if_there(partial(client.get, f"/tasks/{name}"))
        if there is None:
            client.configure_task(name, **settings)
            continue
        differing = [key for key, value in settings.items() if canonical_json(there.get(key)) != canonical_json(value)]
        if differing:
            yield f"task {name!r} exists with other settings, which stay: {', '.join(differing)}"


def _outcome(entry: Entry, handle: Callable[[str, Parcel], ImportResult]) -> ImportResult:
    try:
        parcel = _read(entry)
        if not parcel.metadata["objects"]:
            reason = "the dataset names no objects: give their poses, mask ids or names with --objects FILE"
            return ImportResult(entry.name, "refused", reason)
        return handle(entry.name, parcel)
    except DamagedError as error:
        return ImportResult(entry.name, "damaged", str(error))
    except (InvalidInputError, ServiceProblemError) as error:
        return ImportResult(entry.name, "refused", str(error))


def _read(entry: Entry) -> Parcel:
    try:
        return entry.read()
    except (RoboPromptError, ModuleNotFoundError):  # the latter names an extra
        raise
    except Exception as error:  # whatever a library raises over such a file
        raise DamagedError(entry.name, f"cannot be read: {type(error).__name__}: {error!s:.300}") from error


def _send(client: RoboPromptClient, name: str, parcel: Parcel) -> ImportResult:
    task, key = str(parcel.metadata["task"]), parcel.key
    if client.get("/episodes", upload_key=key)["episodes"]:
        return ImportResult(name, "already_there", "", task, parcel.notes)
    metadata = ("metadata.json", canonical_json(parcel.metadata), "application/json")
    files = {part: (part, data, _MEDIA_TYPE) for part, data in parcel.files.items()}
    answer: dict[str, Any] = client.upload_parts({"metadata": metadata, **files}, key)
    return ImportResult(name, "imported", "", task, parcel.notes, len(answer["keyframes"]))


def _check(name: str, parcel: Parcel) -> ImportResult:
    notes = parcel.notes
    trajectory = trajectory_from_npz(parcel.files["trajectory"])
    motion = Motion.of(trajectory, float(parcel.metadata.get("control_frequency_hz", 20.0)))
    objects = parcel.metadata["objects"]
    unknown = [item["name"] for item in objects if item.get("position") is None and not item.get("mask_ids")]
    if unknown:
        missing = f"no poses or mask ids of {', '.join(unknown)}"
        notes += (f"{missing}: the task's object models must find them in the images",)
    keyframes = len(find_keyframes(motion, KeyframeRule()))
    return ImportResult(name, "imported", "", str(parcel.metadata["task"]), notes, keyframes)


def _summary(dataset: Dataset, results: Sequence[ImportResult]) -> dict[str, Any]:
    def listed(status: str) -> list[dict[str, str]]:
        return [{"episode": item.name, "reason": item.detail} for item in results if item.status == status]

    numbers = Counter(item.status for item in results)
    unlisted = [{"episode": message.partition(":")[0], "reason": message} for message in dataset.damaged]
    return {
        "format": dataset.format,
        "episodes": len(dataset.entries) + len(dataset.damaged),
        "imported": numbers["imported"],
        "already_there": numbers["already_there"],
        "damaged": unlisted + listed("damaged"),
        "refused": listed("refused"),
        "missing": dict(Counter(note for item in results for note in item.notes)),
        "tasks": dict(Counter(item.task for item in results if item.task)),
        "keyframes": sum(item.keyframes for item in results),
    }


def _report(console: Console, summary: dict[str, Any]) -> None:
    lines = []
    for kind in ("damaged", "refused"):
        lines += [f"{kind}: {item['episode']}: {item['reason']}" for item in summary[kind][:MAX_SHOWN]]
        if (more := len(summary[kind]) - MAX_SHOWN) > 0:
            lines.append(f"{kind}: {more} more, listed by --json")
    lines += [f"missing in {number}: {note}" for note, number in summary["missing"].items()]
    verb = "would be imported" if summary["dry_run"] else "imported"
    tasks = ", ".join(f"{name} ({number})" for name, number in summary["tasks"].items()) or "none"
    lines.append(
        f"{summary['format']}, {summary['episodes']} episodes: {summary['imported']} {verb} "
        f"({summary['keyframes']} keyframes), {summary['already_there']} already there, "
        f"{len(summary['damaged'])} damaged, {len(summary['refused'])} refused; tasks: {tasks}"
    )
    if summary["stopped"]:
        lines.append(f"stopped: {summary['stopped']}; the same command goes on from here")
    console.print(*lines, sep="\n", markup=False, highlight=False, soft_wrap=True)
