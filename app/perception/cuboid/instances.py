"""Sightings of things that look alike -> which of them are one and the same, and which one is asked for."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.perception.cuboid.model import CuboidModel
from app.perception.sightings import Miss, Sighting
from app.pipeline.errors import UncertainPoseError
from roboprompt_client.arrays import Array

SAME_SHARE = 0.6  # of its smaller side: two cameras that differ by less see one thing
SAME_SLACK_M = 0.01
TIE_M = 0.005  # the order of two whose distances differ by less is a matter of noise


@dataclass(frozen=True, eq=False)
class Instance:
    """One thing, as the cameras see it.

    Attributes:
        note: what deserves a look in how it was chosen; empty if nothing.
    """

    sightings: tuple[Sighting, ...]
    note: str = ""

    @property
    def position_m(self) -> Array:
        """(3,) where its best sighting puts it."""
        return max(self.sightings, key=lambda s: s.confidence).position_m

    @property
    def confidence(self) -> float:
        """That of the most confident sighting; 0 without any."""
        return max((s.confidence for s in self.sightings), default=0.0)


def instances(found: Sequence[Sighting | Miss], model: CuboidModel) -> list[Instance]:
    """The separate things that were sighted, the most certain first."""
    sightings = [item for item in found if isinstance(item, Sighting)]
    reach_m = SAME_SHARE * min(model.size_m[:2]) + SAME_SLACK_M
    groups: list[list[Sighting]] = []
    for sighting in sorted(sightings, key=lambda s: -s.confidence):
        for group in groups:
            apart_m = float(np.linalg.norm(group[0].position_m - sighting.position_m))
            if apart_m < reach_m and all(sighting.camera != other.camera for other in group):
                group.append(sighting)
                break
        else:
            groups.append([sighting])
    return [Instance(tuple(group)) for group in groups]


def chosen(name: str, model: CuboidModel, found: Sequence[Instance], anchor_m: Array | None) -> Instance:
    """The thing that is asked for.

    Without a rank there may be only one that is certain; further cameras' sightings of it elsewhere stay with it, so
    that the contradiction shows.

    Raises:
        UncertainPoseError: if a camera sees several where there is no rank, or not as many as the rank tells of.
    """
    certain = [item for item in found if item.confidence >= model.min_confidence]
    if model.rank is None:
        return _only(name, certain, found)
    assert anchor_m is not None
    rank = model.rank
    if len(certain) != rank.of:
        message = f"{len(certain)} things that look like it are seen well enough, not {rank.of}: {_described(found)}"
        remedy = f"a view of all {rank.of}, to count from {rank.nearest_to}"
        raise UncertainPoseError(name, message, remedy)
    distances_m = np.array([np.linalg.norm(item.position_m - anchor_m) for item in certain])
    index = int(np.argsort(distances_m)[rank.number - 1])
    ties = np.count_nonzero(np.abs(distances_m - distances_m[index]) < TIE_M) - 1
    note = (
        f"{ties} more that look like it are as far from {rank.nearest_to}, within {1000 * TIE_M:g} mm" if ties else ""
    )
    return replace(certain[index], note=note)


def _only(name: str, certain: Sequence[Instance], found: Sequence[Instance]) -> Instance:
    per_camera: dict[str, list[Sighting]] = {}
    for sighting in (s for item in certain for s in item.sightings):
        per_camera.setdefault(sighting.camera, []).append(sighting)
    for camera, seen in per_camera.items():
        if len(confident := [s for s in seen if s.confidence >= 0.5 * seen[0].confidence]) > 1:
            places = " and ".join(_place(s.position_m) for s in confident)
            message = f"camera {camera} sees {len(confident)} that look like it, at {places}"
            remedy = "one such object in view, a rank in its object model, or another color"
            raise UncertainPoseError(name, message, remedy)
    if certain:
        return Instance(tuple(s for item in certain for s in item.sightings))
    return found[0] if found else Instance(())


def _described(found: Sequence[Instance]) -> str:
    parts = [
        f"{s.camera} sees one at {_place(s.position_m)} with confidence {s.confidence:.2f}"
        + (f" ({s.reason})" if s.reason else "")
        for item in found
        for s in item.sightings[:1]
    ]
    return "; ".join(parts) or "none is seen"


def _place(position_m: Array) -> str:
    return "[" + ", ".join(f"{x:.2f}" for x in position_m) + "] m"
