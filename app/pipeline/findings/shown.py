"""What answers are compared with: the scenes of a task's demonstrations, and how near hands passed objects there."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings.arrangement import RigidPair, Side, rigid_pairs, sides
from app.pipeline.findings.places import ShownPlaces, apart_m
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

HAND = "the end effector"


@dataclass(frozen=True, eq=False)
class ShownScenes:
    """The scenes of demonstrations; what is derived from them is computed once.

    Attributes:
        left_out: demonstrations of plans that no prompt shows.
    """

    demonstrations: tuple[Demonstration, ...]
    left_out: tuple[Demonstration, ...] = ()
    _places: dict[str, ShownPlaces] = field(default_factory=dict, init=False, repr=False)
    _least_apart_m: dict[tuple[str, str], float] = field(default_factory=dict, init=False, repr=False)

    def places(self, name: str) -> ShownPlaces:
        """Return the range of the object's places."""
        if (places := self._places.get(name)) is None:
            places = self._places[name] = ShownPlaces.of([item.object(name) for item in self.demonstrations])
        return places

    @cached_property
    def passed_m(self) -> dict[str | int, float]:
        """The least distances of hands from objects, by name and by the place of the name in the instruction."""
        found: dict[str | int, float] = {}
        for shown in self.demonstrations:
            for pose in shown.objects if shown.actions else ():
                near_m = float(distances_m(way(shown.start, shown.actions), pose.position_m).min())
                keys: list[str | int] = [
                    pose.name,
                    *(k for k, name in enumerate(shown.order.objects) if name == pose.name),
                ]
                found.update({key: min(near_m, found.get(key, math.inf)) for key in keys})
        return found

    @cached_property
    def starts(self) -> ShownPlaces | None:
        """The range of the hand's places before the first action; None if any is not known."""
        poses = [ObjectPose(HAND, item.start.position_m) for item in self.demonstrations if item.start is not None]
        return ShownPlaces.of(poses) if poses and len(poses) == len(self.demonstrations) else None

    @cached_property
    def pairs(self) -> tuple[RigidPair, ...]:
        """The pairs of objects that keep one arrangement."""
        return rigid_pairs(self.demonstrations)

    @cached_property
    def sides(self) -> tuple[Side, ...]:
        """The pairs of objects of which one is always on the same side of the other."""
        return sides(self.demonstrations)

    def least_apart_m(self, one: str, other: str) -> float:
        """Return the least distance between two objects in any scene."""
        if (least_m := self._least_apart_m.get((one, other))) is None:
            least_m = min(apart_m(d.object(one), d.object(other)) for d in self.demonstrations)
            self._least_apart_m[one, other] = least_m
        return least_m


def way(start: EndEffectorAction | None, actions: Sequence[EndEffectorAction]) -> Array:
    """Return (P, 3) the successive positions of the hand."""
    poses = actions if start is None else (start, *actions)
    return np.array([pose.position_m for pose in poses])


def distances_m(way_m: Array, place_m: Array) -> Array:
    """Return (P,) the distance of a place from each segment of a path; the first is that from its start."""
    before_m = np.concatenate([way_m[:1], way_m[:-1]])
    gone_m, to_place_m = way_m - before_m, place_m - before_m
    squared = np.maximum(np.einsum("pk,pk->p", gone_m, gone_m), 1e-12)
    share = np.clip(np.einsum("pk,pk->p", to_place_m, gone_m) / squared, 0, 1)
    distances: Array = np.linalg.norm(to_place_m - share[:, None] * gone_m, axis=1)
    return distances
