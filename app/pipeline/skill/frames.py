"""Which frames a row may follow, and how probable each is before anything is shown: data with log priors in nats.

TAPAS-GMM (arXiv 2407.13432) finds from demonstrations which of a scene's frames matter to a segment; here are more
candidates (origins of single axes, directions, the hand's start), and a prior prefers the simple ones.
"""

from collections.abc import Sequence
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from app.pipeline.skill import turns
from app.pipeline.skill.scene import START, WORLD, Scene, Source
from roboprompt_client.types.arrays import Array

# Log priors, in nats: set once on simulated tasks with 1 to 10 demonstrations
UNNAMED = -2.0  # follows an object that the instruction does not mention
OF_WORLD, OF_START = -1.5, -3.0  # follows no object
MIDDLE = -5.0  # is midway between two objects,
MIDWAY_M = 0.005  # and less so by one for so much distance from there: on every way a hand is somewhere between
ONE_AXIS = -4.0  # one of x, y and z follows something else
OTHER_AXES = -2.0  # axes of another object than the origin's
WORLD_AXES = -0.5  # does not turn with what it follows
DIRECTION = -4.0  # axes that point from one object to another
OTHER_HAND = -2.0  # the rotation follows something else than the place
NEAR_M = 0.10  # the log prior falls by one for so much distance between hand and origin,
FARTHEST = -4.0  # to this at most
LEANS_RAD = np.radians(8)  # an object whose median tilt is larger turns a hand by its whole rotation, not by its yaw
APART_M = 0.05  # objects nearer to each other have no direction
MAX_PAIRED = 4  # objects that an instruction names, from which directions and middles are made


class Frame(NamedTuple):
    """What the coordinates of a row follow.

    Attributes:
        place: of x, y and z along the axes.
        axes: turn the offset of the place.
        hand: turns the rotation.
    """

    place: tuple[Source, Source, Source]
    axes: Source
    hand: Source

    @property
    def objects(self) -> frozenset[str]:
        """The keys of all objects that it depends on."""
        return frozenset(key for source in (*self.place, self.axes, self.hand) for key in source.objects)

    @property
    def needs_start(self) -> bool:
        """Whether it depends on where the hand starts."""
        return START in (*self.place, self.axes, self.hand)


class Candidates(NamedTuple):
    """The sources that a row may follow in some scenes.

    Attributes:
        axes: the last one is the hand's start where that is known, which only rotations follow.
    """

    origins: tuple[Source, ...]
    axes: tuple[Source, ...]

    @property
    def of_place(self) -> tuple[Source, ...]:
        """The axes that a place may be seen along."""
        return tuple(axes for axes in self.axes if axes != START)

    @classmethod
    def of(cls, scenes: Scene) -> "Candidates":
        """Return those of N scenes: the world, the start, each object, and pairs of those that words name."""
        named = [key for key in scenes.keys if is_named(key)][:MAX_PAIRED]
        pairs = [(one, other) for one, other in permutations(named, 2) if _apart_m(scenes, one, other) > APART_M]
        objects = tuple(Source("object", key) for key in scenes.keys)
        middles = tuple(Source("between", one, other) for one, other in combinations(named, 2))
        start = (START,) if scenes.knows_start else ()
        turning = [
            key
            for k, (key, period) in enumerate(zip(scenes.keys, scenes.symmetry, strict=True))
            if period != 0 and not np.isnan(scenes.measured[:, k]).any()
        ]
        own = tuple(Source("leaning" if _leans(scenes, key) else "object", key) for key in turning)
        directions = tuple(Source("toward", one, other) for one, other in pairs)
        return cls((WORLD, *start, *objects, *middles), (WORLD, *own, *directions, *start))

    def place_prior(self, scenes: Scene, hand: Array) -> Array:
        """Return the log priors (R, P, O) of axes and origin, for hands (N, R, 3)."""
        base = np.zeros((hand.shape[1], len(self.of_place), len(self.origins)))
        for o, origin in enumerate(self.origins):
            base[:, :, o] += self._near(origin, scenes, hand)[:, None]
            base[:, :, o] += [_axes_prior(axes, origin) for axes in self.of_place]
        return base

    def _near(self, origin: Source, scenes: Scene, hand: Array) -> Array:
        """Return the log prior (R,) of an origin: hands act at things, mostly at those that words name."""
        flat = {"world": OF_WORLD, "start": OF_START}.get(origin.kind)
        if flat is not None:
            return np.full(hand.shape[1], flat + FARTHEST / 2)
        off = hand - scenes.origin(origin)[:, None]
        if origin.kind == "between":
            level: Array = np.median(np.linalg.norm(off[..., :2], axis=2), axis=0)
            return MIDDLE - level / MIDWAY_M
        far = np.median(np.linalg.norm(off, axis=2), axis=0)
        near: Array = (0.0 if is_named(origin.one) else UNNAMED) + np.maximum(-far / NEAR_M, FARTHEST)
        return near

    def hand_prior(self) -> Array:
        """Return the log priors (P, A) of what the rotation follows, beside the axes of the place."""
        of = np.array([{"toward": DIRECTION, "start": OF_START}.get(hand.kind, 0.0) for hand in self.axes])
        same = np.eye(len(self.of_place), len(self.axes), dtype=bool)
        prior: Array = np.where(same, 0.0, OTHER_HAND) + of
        return prior


def is_named(key: str) -> bool:
    """Return whether a key is a role in the instruction."""
    return key.startswith("<")


def _axes_prior(axes: Source, origin: Source) -> float:
    """Return the log prior of the axes along which a place is seen from an origin."""
    if not origin.objects:
        return 0.0 if axes == WORLD else OTHER_AXES
    if axes.kind == "toward":
        return DIRECTION if origin.kind == "object" and origin.one == axes.one else -np.inf
    if axes == WORLD:
        return WORLD_AXES
    return 0.0 if axes.one == origin.one and origin.kind == "object" else OTHER_AXES


def _leans(scenes: Scene, key: str) -> bool:
    up = turns.rotated(scenes.turn[:, scenes.keys.index(key)], turns.UP)[:, 2]
    return bool(np.arccos(np.clip(np.median(up), -1, 1)) > LEANS_RAD)


def _apart_m(scenes: Scene, one: str, other: str) -> float:
    places: Sequence[Array] = [scenes.place[:, scenes.keys.index(key), :2] for key in (one, other)]
    return float(np.linalg.norm(places[1] - places[0], axis=1).min())
