"""A scene as arrays, and the sources of task-parameterised frames that it offers.

Calinon, "A tutorial on task-parameterized movement learning and retrieval" (2016): a scene is a set of frames, each
with an origin and axes, and a motion is seen from all of them. Names of objects may contain any character, so that a
source is a small tuple and no text to be parsed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np

from app.pipeline.episode import Query
from app.pipeline.geometry import canonical_pose
from app.pipeline.names import folded_name
from app.pipeline.skill import turns
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

GRASPED_M = 0.08  # a hand that closes within this of an object's middle grasps it: of the 22 tasks all do
UNKNOWN_PLACE, UNKNOWN_TURN = np.full(3, np.nan), np.full(4, np.nan)


class Source(NamedTuple):
    """Something that a coordinate may follow.

    Attributes:
        kind: `world`; `start`, the hand before it moves; `object`, its place and its yaw; `leaning`, an object's whole
            rotation; `toward`, level axes of which x points from one object to the other; `between`, the middle of two.
        one, other: keys of objects.
    """

    kind: Literal["world", "start", "object", "leaning", "toward", "between"]
    one: str = ""
    other: str = ""

    @property
    def objects(self) -> tuple[str, ...]:
        """The keys of the objects that it depends on."""
        return tuple(key for key in (self.one, self.other) if key)

    def named(self, names: Mapping[str, str]) -> str:
        """Return it in words, with objects' names by their keys."""
        return self._replace(one=names.get(self.one, self.one), other=names.get(self.other, self.other)).described

    @property
    def described(self) -> str:
        """In words: `cup`, `cup toward plate`, `the world`."""
        joined = {"toward": " toward ", "between": " and ", "world": "the world", "start": "the start"}
        return joined.get(self.kind, "").join(self.objects) if self.one else joined[self.kind]


WORLD, START = Source("world"), Source("start")


@dataclass(frozen=True, eq=False)
class Scene:
    """K objects and a hand; with leading axes (...) many scenes at once, of which all have these objects.

    Attributes:
        keys: of the objects: their role in the instruction, as "<0>", or their name.
        place, turn: (..., K, 3) m and (..., K, 4) xyzw in the world, turned to one side where they are symmetric;
            the identity where no rotation was measured.
        start, start_turn: (..., 3) and (..., 4) of the hand before it moves; NaN where that is not known.
        symmetry: (K,) degrees after which an object looks the same, 0 where round, None where nobody has said.
        names: (K,) of a single scene's objects.
        measured: (..., K, 4) rotations as they were measured, NaN where they were not.
    """

    keys: tuple[str, ...]
    place: Array
    turn: Array
    start: Array
    start_turn: Array
    symmetry: tuple[float | None, ...]
    names: tuple[str, ...]
    measured: Array
    _axes: dict[Source, Array] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, query: Query, symmetry: Mapping[str, float] | None = None) -> "Scene":
        """Return the scene of a query or a demonstration.

        Args:
            symmetry: degrees by name of object, 0 for a round one.
        """
        names = tuple(folded_name(pose.name) for pose in query.objects)
        period = {folded_name(name): value for name, value in (symmetry or {}).items()}
        role = {folded_name(pose.name): query.order.placeholder(pose.name) for pose in query.objects}
        alike = [canonical_pose(pose, period.get(name)) for pose, name in zip(query.objects, names, strict=True)]
        hand = query.start
        return cls(
            tuple(role[name] for name in names),
            np.array([pose.position_m for pose in query.objects]).reshape(-1, 3),
            _rotations([pose.quaternion_xyzw for pose in alike], turns.IDENTITY),
            UNKNOWN_PLACE if hand is None else np.array(hand.position_m),
            UNKNOWN_TURN if hand is None else np.array(hand.quaternion_xyzw),
            tuple(period.get(name) for name in names),
            names,
            _rotations([pose.quaternion_xyzw for pose in query.objects], UNKNOWN_TURN),
        )

    @classmethod
    def stacked(cls, scenes: Sequence["Scene"], keys: Sequence[str]) -> "Scene":
        """Return N scenes as one, with the objects of these keys, which all of them have."""
        each = [scene.only(keys) for scene in scenes]
        arrays = {name: np.array([getattr(scene, name) for scene in each]) for name in ARRAYS}
        return cls(keys=tuple(keys), symmetry=each[0].symmetry, names=tuple(keys), **arrays)

    def only(self, keys: Sequence[str]) -> "Scene":
        """Return the scene with only these objects, in this order."""
        at = [self.keys.index(key) for key in keys]
        few = {name: getattr(self, name)[..., at, :] for name in ("place", "turn", "measured")}
        names, symmetry = tuple(self.names[k] for k in at), tuple(self.symmetry[k] for k in at)
        return replace(self, keys=tuple(keys), names=names, symmetry=symmetry, **few)

    def one(self, n: int) -> "Scene":
        """Return the n-th of many scenes."""
        return replace(self, **{name: getattr(self, name)[n] for name in ARRAYS})

    def by_name(self) -> "Scene":
        """Return a single scene with its objects' names as keys."""
        return replace(self, keys=self.names)

    @property
    def knows_start(self) -> bool:
        """Whether it is known where the hand is."""
        return not bool(np.isnan(self.start_turn).any())

    @property
    def shape(self) -> tuple[int, ...]:
        """The leading axes."""
        return self.start.shape[:-1]

    def origin(self, source: Source) -> Array:
        """Return the place (..., 3) of a source."""
        if source.kind == "world":
            return np.zeros((*self.shape, 3))
        if source.kind == "start":
            return self.start
        places = [self.place[..., self.keys.index(key), :] for key in source.objects]
        found: Array = (places[0] + places[1]) / 2 if source.kind == "between" else places[0]
        return found

    def axes(self, source: Source) -> Array:
        """Return the rotation (..., 4) of a source."""
        if source not in self._axes:
            self._axes[source] = self._axes_of(source)
        return self._axes[source]

    def as_turned(self, query: Query) -> tuple[ObjectPose, ...]:
        """Return the poses of a query with the objects' rotations as they are here, where they were measured."""
        turned = []
        for pose in query.objects:
            key = query.order.placeholder(pose.name)
            if pose.quaternion_xyzw is None or key not in self.keys:
                turned.append(pose)
            else:
                turned.append(replace(pose, quaternion_xyzw=self.turn[self.keys.index(key)]))
        return tuple(turned)

    def _axes_of(self, source: Source) -> Array:
        if source.kind == "start":
            return self.start_turn
        if source.kind == "toward":
            one, other = (self.place[..., self.keys.index(key), :] for key in source.objects)
            way = other - one
            return turns.about_z(np.arctan2(way[..., 1], way[..., 0]))
        if source.kind in ("world", "between"):
            return np.broadcast_to(turns.IDENTITY, (*self.shape, 4))
        own: Array = self.turn[..., self.keys.index(source.one), :]
        return own if source.kind == "leaning" else turns.about_z(turns.yaw(own))

    def turned(self, key: str, angle_rad: Array) -> "Scene":
        """Return the scene with an object turned about its own z axis by angles (...)."""
        turn, k = self.turn.copy(), self.keys.index(key)
        turn[..., k, :] = turns.product(turn[..., k, :], turns.about_z(angle_rad))
        return replace(self, turn=turn)

    def after(self, actions: Sequence[EndEffectorAction]) -> "Scene":
        """Return the scene after these actions: what the hand holds moves with it, and lies where it is let go.

        A hand that closes takes the nearest object.
        """
        place, turn, held, grip = self.place.copy(), self.turn.copy(), None, None
        is_open = True
        for action in actions:
            if held is not None and grip is not None:
                place[held] = action.position_m + turns.rotated(action.quaternion_xyzw, grip[0])
                turn[held] = turns.product(action.quaternion_xyzw, grip[1])
            if is_open and not action.gripper_open and len(place):
                away = np.linalg.norm(place - action.position_m, axis=1)
                held = int(away.argmin()) if away.min() <= GRASPED_M else None
                if held is not None:
                    back = turns.inverse(action.quaternion_xyzw)
                    grip = turns.rotated(back, place[held] - action.position_m), turns.product(back, turn[held])
            elif action.gripper_open:
                held, grip = None, None
            is_open = action.gripper_open
        hand = actions[-1]
        return replace(self, place=place, turn=turn, start=hand.position_m, start_turn=hand.quaternion_xyzw)


ARRAYS = ("place", "turn", "start", "start_turn", "measured")


def _rotations(given: Sequence[Array | None], missing: Array) -> Array:
    return np.array([missing if one is None else one for one in given]).reshape(-1, 4)
