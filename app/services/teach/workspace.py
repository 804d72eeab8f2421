"""The workspace `auto` of a task: what its demonstrations span, with a margin.

An upload may make an edge at most twice as long as the first three demonstrations made it. One that reaches farther is
stored and reported, but moves no bound until a person who may configure the task sets the workspace, e.g. to `auto`
again, which takes all demonstrations as they are. Where the first two are so far apart, the third shows which one is
the odd one.
"""

from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np

from app.pipeline.findings import Finding
from app.pipeline.workspace import RLBENCH_MAX_M, RLBENCH_MIN_M, Workspace
from app.services.setting_parts import WorkspaceSettings
from app.store.records import DemonstrationRecord
from app.store.values import KeyframeRecord, ObjectRecord
from roboprompt_client.types.arrays import Array

NUM_FIRST = 3  # demonstrations that say how large the task is; fewer say little
MAX_GROWTH = 2.0  # of an edge, beyond what the first ones span


class Extent(Protocol):
    """The positions of hand and objects in an episode."""

    @property
    def keyframes(self) -> Sequence[KeyframeRecord]: ...

    @property
    def objects(self) -> Sequence[ObjectRecord]: ...


def spanned(box: WorkspaceSettings, episodes: Iterable[Extent]) -> WorkspaceSettings:
    """Return the workspace that these episodes span; one that does not follow from them stays."""
    if box.preset != "auto":
        return box
    box = WorkspaceSettings(preset="auto")
    for episode in episodes:
        box = grown(box, _places_m(episode))
    return box


def remaining(box: WorkspaceSettings, episodes: Iterable[Extent]) -> WorkspaceSettings:
    """Return the workspace after a deletion; episodes that did not move it still do not."""
    return spanned(box, [episode for episode in episodes if _holds(box, episode)])


def widened(box: WorkspaceSettings, episode: Extent, first: Sequence[Extent]) -> WorkspaceSettings:
    """Return the workspace with room for one more episode; unchanged where it reaches too far beyond the others.

    Args:
        first: the task's first `NUM_FIRST` demonstrations; fewer say little about how far is too far.
    """
    wider = grown(box, _places_m(episode))
    if not first or wider == box:
        return wider
    most_m = np.maximum(MAX_GROWTH * _edges_m(remaining(box, first)), _edges_m(box))
    return box if (_edges_m(wider) > most_m + 1e-9).any() else wider


def uploaded(
    box: WorkspaceSettings, episode: Extent, first: Sequence[DemonstrationRecord], *, stays: bool = False
) -> tuple[WorkspaceSettings, list[Finding]]:
    """Return the workspace after an upload, and findings about episodes that lie outside and may not widen it.

    Args:
        first: the demonstrations that came before it, of which the first `NUM_FIRST` count.
        stays: the episode moves no bound.
    """
    first = first[:NUM_FIRST]
    is_third = len(first) == NUM_FIRST - 1
    if is_third and not stays and not all(_holds(box, shown) for shown in first):
        box = spanned(box, _without_odd_one((*first, episode)))
    elif not stays:
        box = widened(box, episode, first)
    earlier = [(f"Episode {item.id}", item) for item in first] if is_third else []
    named: list[tuple[str, Extent]] = [("The recording", episode), *earlier]
    beyond = [] if box.preset != "auto" else [(name, shown) for name, shown in named if not _holds(box, shown)]
    return box, [_beyond(box, name, shown) for name, shown in beyond]


def grown(box: WorkspaceSettings, positions_m: Array) -> WorkspaceSettings:
    """Return a box `auto` that holds these demonstrated positions (N, 3) as well; another one as it is.

    A box that still is RLBench's comes from no demonstration: it is not kept.
    """
    if box.preset != "auto" or not len(positions_m):
        return box
    untaught = (box.min, box.max) == (RLBENCH_MIN_M, RLBENCH_MAX_M)
    held = Workspace.around(positions_m, None if untaught else Workspace(np.array(box.min), np.array(box.max)))
    return WorkspaceSettings(preset="auto", min=tuple(held.min_m.tolist()), max=tuple(held.max_m.tolist()))


def _beyond(box: WorkspaceSettings, name: str, shown: Extent) -> Finding:
    wanted = grown(box, _places_m(shown))
    message = (
        f"{name} reaches beyond the task's workspace, {_text(box)}, by far more than the first {NUM_FIRST}"
        f" demonstrations span: the workspace does not follow it. If it is right, somebody who may configure the"
        f' task sets "workspace" to "auto" again, which makes it {_text(wanted)}; otherwise delete the episode.'
    )
    numbers = {"edge_m": float(_edges_m(box).max()), "wanted_edge_m": float(_edges_m(wanted).max())}
    return Finding("beyond-workspace", "warning", message, "workspace", numbers)


def _without_odd_one(shown: Sequence[Extent]) -> Sequence[Extent]:
    """Without the one that alone makes an edge more than `MAX_GROWTH` times as long; all, unless there is just one."""
    any_box = WorkspaceSettings(preset="auto")
    all_m = _edges_m(spanned(any_box, shown))
    rests = [[other for other in shown if other is not one] for one in shown]
    near = [rest for rest in rests if (all_m > MAX_GROWTH * _edges_m(spanned(any_box, rest))).any()]
    return near[0] if len(near) == 1 else shown


def _places_m(episode: Extent) -> Array:
    """(N, 3) of the hand at its keyframes and of the objects."""
    return np.array([item.position_m for items in (episode.keyframes, episode.objects) for item in items])


def _holds(box: WorkspaceSettings, episode: Extent) -> bool:
    places_m = _places_m(episode)
    return bool(((places_m >= box.min) & (places_m <= box.max)).all())


def _edges_m(box: WorkspaceSettings) -> Array:
    return np.subtract(box.max, box.min)


def _text(box: WorkspaceSettings) -> str:
    return f"{list(box.min)} to {list(box.max)} m"
