"""A task's workspace follows from what its demonstrations showed, until somebody sets one."""

from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np

from app.services.task_settings import TaskSettings
from app.store.values import KeyframeRecord, ObjectRecord


class Shown(Protocol):
    """What an episode shows: where the hand and the objects were."""

    @property
    def keyframes(self) -> Sequence[KeyframeRecord]: ...

    @property
    def objects(self) -> Sequence[ObjectRecord]: ...


def with_room_for(settings: TaskSettings, episodes: Iterable[Shown]) -> TaskSettings:
    """The settings with a workspace that holds the episodes, where it follows from demonstrations."""
    places = [
        item.position_m for episode in episodes for items in (episode.keyframes, episode.objects) for item in items
    ]
    if settings.workspace.preset != "auto" or not places:
        return settings
    return settings.model_copy(update={"workspace": settings.workspace.grown(np.array(places))})
