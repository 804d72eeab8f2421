"""The workspace of a task whose preset is `auto`: what its present demonstrations span, with a margin.

An upload may make an edge at most twice as long as the first three demonstrations made it. One that reaches farther is
stored and reported, but moves no bound until somebody who may configure the task sets the workspace, e.g. to `auto`
again, which takes all demonstrations as they are. Where the first two are so far apart, the third tells which one is
the odd one.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

import numpy as np

from app.pipeline.findings import Finding
from app.services.setting_parts import WorkspaceSettings
from app.services.task_settings import TaskSettings
from app.store.records import DemonstrationRecord
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
    return _within(settings, _box(episodes))


def remaining(settings: TaskSettings, episodes: Iterable[Shown]) -> TaskSettings:
    """The settings after a deletion; episodes that did not move the workspace still do not."""
    return spanned(settings, [episode for episode in episodes if _holds(settings.workspace, episode)])


def widened(settings: TaskSettings, episode: Shown, first: Sequence[Shown]) -> TaskSettings:
    """The settings with room for one more episode; unchanged where it reaches too far beyond the others.

    Args:
        first: the task's first `FIRST` demonstrations; fewer say little about how far is too far.
    """
    box = settings.workspace.grown(_places_m(episode))
    return settings if _jumps(settings, box, first) else _within(settings, box)


def uploaded(settings: TaskSettings, episode: Shown, first: Sequence[Shown]) -> TaskSettings:
    """The settings after an upload.

    Args:
        first: at most `FIRST` demonstrations that came before it.
    """
    if len(first) == FIRST - 1 and not all(_holds(settings.workspace, shown) for shown in first):
        return spanned(settings, _without_odd_one((*first, episode)))
    return widened(settings, episode, first)


def room_findings(settings: TaskSettings, episode: Shown, first: Sequence[DemonstrationRecord]) -> Iterator[Finding]:
    """Says which episodes lie outside of the workspace of their task, and were not allowed to widen it.

    Args:
        settings: after the upload of `episode`.
        first: as in `uploaded`.
    """
    box = settings.workspace
    if box.preset != "auto":
        return
    earlier = first if len(first) == FIRST - 1 else ()
    for name, shown in [("The recording", episode), *((f"Episode {item.id}", item) for item in earlier)]:
        if _holds(box, shown):
            continue
        wanted = box.grown(_places_m(shown))
        message = (
            f"{name} reaches beyond the task's workspace, {_text(box)}, by far more than the first {FIRST}"
            f" demonstrations span: the workspace does not follow it. If it is right, somebody who may configure the"
            f' task sets "workspace" to "auto" again, which makes it {_text(wanted)}; otherwise delete the episode.'
        )
        numbers = {"edge_m": float(_edges_m(box).max()), "wanted_edge_m": float(_edges_m(wanted).max())}
        yield Finding("beyond-workspace", "warning", message, "workspace", numbers)


def _without_odd_one(shown: Sequence[Shown]) -> Sequence[Shown]:
    """Without the one that alone makes an edge more than `MAX_GROWTH` times as long; all, unless there is just one."""
    all_m = _edges_m(_box(shown))
    rests = [[other for other in shown if other is not one] for one in shown]
    near = [rest for rest in rests if (all_m > MAX_GROWTH * _edges_m(_box(rest))).any()]
    return near[0] if len(near) == 1 else shown


def _box(episodes: Iterable[Shown]) -> WorkspaceSettings:
    box = WorkspaceSettings(preset="auto")
    for episode in episodes:
        box = box.grown(_places_m(episode))
    return box


def _jumps(settings: TaskSettings, box: WorkspaceSettings, first: Sequence[Shown]) -> bool:
    if not first or box == settings.workspace:
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
