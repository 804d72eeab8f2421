"""The workspace of a task whose preset is `auto`: what its present demonstrations span, with a margin.

An upload may make an edge at most twice as long as the first three demonstrations made it. One that reaches farther is
stored and reported, but moves no bound until somebody who may configure the task sets the workspace, e.g. to `auto`
again, which takes all demonstrations as they are.
"""

from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np

from app.pipeline.findings import Finding
from app.services.setting_parts import WorkspaceSettings
from app.services.task_settings import TaskSettings
from app.store.values import KeyframeRecord, ObjectRecord
from roboprompt_client.arrays import Array

FIRST = 3  # demonstrations that say how large the task is; fewer say little
MAX_GROWTH = 2.0  # of an edge, beyond what the first ones span


class Shown(Protocol):
    """What an episode shows: where the hand and the objects were."""

    @property
    def keyframes(self) -> Sequence[KeyframeRecord]: ...

    @property
    def objects(self) -> Sequence[ObjectRecord]: ...


def spanned(settings: TaskSettings, episodes: Iterable[Shown]) -> TaskSettings:
    """The settings with the workspace that these episodes span, one after the other, where it follows from them."""
    if settings.workspace.preset != "auto":
        return settings
    box = WorkspaceSettings(preset="auto")
    for episode in episodes:
        box = box.grown(_places_m(episode))
    return _within(settings, box)


def remaining(settings: TaskSettings, episodes: Iterable[Shown]) -> TaskSettings:
    """The settings after a deletion; episodes that did not move the workspace still do not."""
    return spanned(settings, [episode for episode in episodes if _holds(settings.workspace, episode)])


def widened(settings: TaskSettings, episode: Shown, first: Sequence[Shown]) -> TaskSettings:
    """The settings with room for one more episode; unchanged where it reaches too far beyond the others.

    Args:
        first: the task's first `FIRST` demonstrations, or as many as there are.
    """
    box = settings.workspace.grown(_places_m(episode))
    return settings if _jumps(settings, box, first) else _within(settings, box)


def room_findings(settings: TaskSettings, episode: Shown) -> tuple[Finding, ...]:
    """Says that an episode lies outside of the workspace of its task, which the episode was not allowed to widen."""
    box = settings.workspace
    if box.preset != "auto" or _holds(box, episode):
        return ()
    wanted = box.grown(_places_m(episode))
    message = (
        f"The recording reaches beyond the task's workspace, {_text(box)}, by far more than the first {FIRST}"
        f" demonstrations span: the workspace stays as it is. If the recording is right, somebody who may configure the"
        f' task sets "workspace" to "auto" again, which makes it {_text(wanted)}; otherwise delete the episode.'
    )
    numbers = {"edge_m": float(_edges_m(box).max()), "wanted_edge_m": float(_edges_m(wanted).max())}
    return (Finding("beyond-workspace", "warning", message, "workspace", numbers),)


def _jumps(settings: TaskSettings, box: WorkspaceSettings, first: Sequence[Shown]) -> bool:
    if len(first) < FIRST or box == settings.workspace:
        return False
    usual_m = _edges_m(remaining(settings, first).workspace)
    return bool((_edges_m(box) > np.maximum(MAX_GROWTH * usual_m, _edges_m(settings.workspace)) + 1e-9).any())


def _within(settings: TaskSettings, box: WorkspaceSettings) -> TaskSettings:
    return settings.model_copy(update={"workspace": box})


def _places_m(episode: Shown) -> Array:
    """(N, 3) of the hand at its keyframes and of the objects."""
    return np.array([item.position_m for items in (episode.keyframes, episode.objects) for item in items])


def _holds(box: WorkspaceSettings, episode: Shown) -> bool:
    places_m = _places_m(episode)
    return bool(((places_m >= box.min) & (places_m <= box.max)).all())


def _edges_m(box: WorkspaceSettings) -> Array:
    return np.subtract(box.max, box.min)


def _text(box: WorkspaceSettings) -> str:
    return f"{list(box.min)} to {list(box.max)} m"
