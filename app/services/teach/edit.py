"""Correct an episode."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from app.pipeline.errors import UnfamiliarInstructionError
from app.pipeline.order.reading import read
from app.pipeline.order.taught import TaughtWords
from app.services.extract import read_episode, reading
from app.services.task_settings import TaskSettings
from app.store import episodes
from app.store.records import EpisodeRecord
from app.store.store import Store
from roboprompt_client.types.names import checked_instruction


def edit_episode(store: Store, episode_id: str, changes: Mapping[str, Any]) -> EpisodeRecord:
    """Change `instruction`, `left_out` or `note` of an episode.

    Raises:
        NotFoundError: if there is no such episode.
        InvalidInputError: if the instruction names no object of the task, or the episode cannot be extracted with the
            task's settings.
    """
    record, settings = read_episode(store, episode_id)
    if record.left_out and changes.get("left_out") is False:
        with reading(store, record.task, [episode_id]):
            pass  # it can be extracted
    if "instruction" in changes:
        with store.read() as connection:
            taught = episodes.instructions(connection, record.task)
        changes = {**changes, "instruction": checked_instruction("instruction", changes["instruction"])}
        _check_objects(changes["instruction"], record, settings, taught)
    with store.write() as connection:
        episodes.edit(connection, record, changes)
        return episodes.get(connection, record.id)


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
