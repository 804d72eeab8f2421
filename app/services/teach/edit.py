"""Correct or delete an episode. A workspace `auto` follows from those that are left."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from sqlalchemy import Connection

from app.pipeline.errors import UnfamiliarInstructionError
from app.pipeline.findings import Finding
from app.pipeline.order.reading import read
from app.pipeline.order.taught import TaughtWords
from app.services.setting_parts import WorkspaceSettings
from app.services.task_settings import TaskSettings
from app.services.teach.configure import require_no_job
from app.services.teach.extract import extract_again
from app.services.teach.trim import trimmed
from app.services.teach.workspace import NUM_FIRST, remaining, uploaded
from app.store import episodes, tasks
from app.store.records import EpisodeRecord, Extraction, TaskRecord
from app.store.store import Store
from roboprompt_client.types.names import checked_instruction


def edit_episode(store: Store, episode_id: str, changes: Mapping[str, Any]) -> EpisodeRecord:
    """Change `instruction`, `left_out`, `note` or `trim` of an episode.

    A trimmed episode, and one that prompts show again, is extracted again, as the task's settings may have changed, and
    a workspace `auto` is what the shown ones span.

    Raises:
        NotFoundError: if there is no such episode.
        InvalidInputError: if the instruction names no object of the task, or the episode cannot be trimmed so or
            extracted again.
        ConflictError: if the task changed meanwhile, or a job extracts its episodes again.
    """
    with store.read() as connection:
        record = episodes.get(connection, episode_id)
        task = tasks.get(connection, record.task)
        taught = episodes.instructions(connection, record.task)
    settings = TaskSettings.model_validate(task.settings)
    if "instruction" in changes:
        changes = {**changes, "instruction": checked_instruction("instruction", changes["instruction"])}
        _check_objects(changes["instruction"], record, settings, taught)
    left_out = changes.get("left_out", record.left_out)
    again = None
    if "trim" in changes:
        corrected = replace(record, instruction=changes.get("instruction", record.instruction))
        again, fields = trimmed(store, corrected, settings, changes["trim"])
        changes = {**changes, **fields}
    elif record.left_out and not left_out:
        again = extract_again(store, record, settings)
    with store.write() as connection:
        if again is None and left_out == record.left_out:
            return episodes.edit(connection, record, changes)
        tasks.require_version(connection, task.name, task.version)
        if again is not None:
            require_no_job(connection, task.name)
            episodes.replace_extractions(connection, task.name, task.version, [again])
        edited = episodes.edit(connection, record, changes)
        doubts = _follow(connection, task, None if left_out else again)
        if "trim" in changes and doubts:
            found = (*(doubt.to_json() for doubt in doubts), *(edited.findings or ()))
            episodes.edit(connection, edited, {"findings": found})
        return episodes.get(connection, record.id)


def _follow(connection: Connection, task: TaskRecord, shown: Extraction | None) -> list[Finding]:
    """Let a workspace `auto` be what the demonstrations span, and make room for the one that is shown anew, if any.

    Returns:
        The findings about episodes that lie outside of it.
    """
    _narrow_workspace(connection, task)
    if shown is None:
        return []
    others = [item for item in episodes.demonstrations(connection, task.name) if item.id != shown.episode_id]
    box, doubts = uploaded(TaskSettings.of(connection, task.name).workspace, shown, others[:NUM_FIRST])
    _set_workspace(connection, task, box)
    return doubts


def remove_episode(store: Store, episode_id: str) -> str:
    """Delete the episode; its images go with the next sweep.

    Returns:
        The task.

    Raises:
        NotFoundError: if there is no such episode.
    """
    with store.write() as connection:
        name = episodes.remove(connection, episode_id)
        _narrow_workspace(connection, tasks.get(connection, name))
    return name


def _narrow_workspace(connection: Connection, task: TaskRecord) -> None:
    box = TaskSettings.model_validate(task.settings).workspace
    if box.preset == "auto":
        _set_workspace(connection, task, remaining(box, episodes.demonstrations(connection, task.name)))


def _set_workspace(connection: Connection, task: TaskRecord, box: WorkspaceSettings) -> None:
    tasks.update_settings(connection, task.name, {**task.settings, "workspace": box.model_dump(mode="json")})


def _check_objects(instruction: str, record: EpisodeRecord, settings: TaskSettings, taught: tuple[str, ...]) -> None:
    """Refuse words that stand for no object of the task, or for several.

    Raises:
        UngroundedInstructionError: saying which.
    """
    names = [item.name for item in record.objects]
    words = TaughtWords(names, settings.aliases, (*taught, record.instruction))
    places_m = {item.name: np.array(item.position_m) for item in record.objects}
    with suppress(UnfamiliarInstructionError):  # other words than before are why it is corrected
        read(instruction, words, settings.layout(places_m))
