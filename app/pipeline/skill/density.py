"""Where objects and the hand are in ordinary scenes, and what of a scene is a surprise.

Each coordinate of a scene (places and heights in the world, tilts, yaws, places from each other) is a normal around one
center whose spread is unknown. A prior over spreads says what is ordinary before anything is shown: things stand
upright, at one height, anywhere on a table, at any yaw. Each demonstration makes the mixture of spreads sharper: few
demonstrations widen the predictive and switch nothing off (Murphy 2007, with the variance on a grid).
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import logsumexp, ndtr

from app.pipeline.skill import turns
from app.pipeline.skill.scene import Scene
from roboprompt_client.types.arrays import Array

HAND, ALL = "the hand", "the lowest object"
POSE_M, POSE_RAD = 0.004, np.radians(2.5)  # errors of pose estimators with few outliers
HAND_M, HAND_RAD = 0.09, np.radians(8)  # a hand starts where one left it: of people's recordings
GRADES = 3.0 ** np.arange(5)  # spreads from scene to scene, in units of the least one
LEAST_LOG = 0.02  # least spread of a distance's logarithm
# How probable each spread is before anything is shown, the least first
ANYWHERE = (0.04, 0.06, 0.2, 0.4, 0.3)
FIXED = 0.006  # of the second spread of heights and tilts; each further one is a third as probable
LEFT = 0.002  # the same of the hand's start
INSIDE_M, INSIDE_P = 0.025, 2e-4  # things that were never so near are not inside each other
LEAST_P = 1e-300  # has a logarithm
FAR_P = 1e-6  # of a demonstration left out that is in another world
EXACT = 1e-7  # continuous measurements are never so equal
USUAL = 2.0  # spreads to both sides that a usual range has
LEAST_M = 1e-4  # between things, so that distances have a logarithm

Kind = Literal["level", "height", "tilt", "yaw", "distance", "hand place", "hand tilt", "hand yaw"]


class Surprise(NamedTuple):
    """A coordinate that is unlike what demonstrations show.

    Attributes:
        about: the object, or the hand.
        usual: the range of most demonstrations; m or rad as the value.
        p: how often chance alone is as far off.
    """

    about: str
    coordinate: str
    value: float
    usual: tuple[float, float]
    p: float


class Coordinate(NamedTuple):
    """A coordinate of a scene.

    Attributes:
        other: from which object it is seen; empty for the world.
    """

    about: str
    name: str
    kind: Kind
    other: str = ""

    @property
    def of_world(self) -> bool:
        """Whether it is an object's own, in the world."""
        return not self.other and self.about not in (HAND, ALL)


@dataclass(frozen=True, eq=False)
class SceneDensity:
    """The predictive of C coordinates.

    Attributes:
        scenes: by name, of the demonstrations.
        coordinates: (C,); `origin`: (K + 1,) the mean yaws of objects and hand.
        values: (N, C) of the demonstrations; `kept`: which are not in another world than the others.
        least: (C,) errors of measurements.
        center: (C,); `sigma`, `weight`: (C, G) of the normal distributions.
    """

    scenes: Scene
    coordinates: tuple[Coordinate, ...]
    origin: Array
    values: Array
    kept: npt.NDArray[np.bool_]
    least: Array
    center: Array
    sigma: Array
    weight: Array

    @classmethod
    def learned(cls, given: Sequence[Scene]) -> "SceneDensity":
        """Return the density of demonstrated scenes, over the objects that all of them have."""
        names = sorted(set.intersection(*(set(scene.names) for scene in given)))
        return cls.of_scenes(Scene.stacked([scene.by_name() for scene in given], names))

    @classmethod
    def of_scenes(cls, scenes: Scene) -> "SceneDensity":
        """Return the density of N scenes whose keys are names."""
        origin = _origins(scenes)
        coordinates = _coordinates(scenes)
        values = _values(scenes, origin)
        known = np.array([item.kind for item in coordinates])
        least = np.array([_LEAST[kind] for kind in known])
        kept = _kept(values, least)
        number = np.maximum(kept.sum(axis=0), 1)
        center = np.where(kept, values, 0).sum(axis=0) / number
        squares = (np.where(kept, values - center, 0) ** 2).sum(axis=0)
        spread = least[:, None] * GRADES
        prior = np.log(np.array([_PRIOR[kind] for kind in known]))
        log = prior - (number[:, None] - 1) * np.log(spread) - squares[:, None] / (2 * spread**2)
        weight = np.exp(log - logsumexp(log, axis=1, keepdims=True))
        sigma = np.sqrt(spread**2 * (1 + 1 / number[:, None]) + least[:, None] ** 2)
        return cls(scenes, coordinates, origin, values, kept, least, center, sigma, weight)

    def among(self, names: Collection[str]) -> "SceneDensity":
        """Return the density of only those objects that have these names."""
        shared = [key for key in self.scenes.keys if key in names]
        return self if len(shared) == len(self.scenes.keys) else self.of_scenes(self.scenes.only(shared))

    def surprises(self, scene: Scene, most_p: float) -> list[Surprise]:
        """Return what of a scene is less probable than `most_p`, the least probable first."""
        values = _values(scene.by_name().only(self.scenes.keys), self.origin)
        p = self.p_values(values)
        scale = np.take_along_axis(self.sigma, self.weight.argmax(axis=1)[:, None], 1)[:, 0]
        found = []
        for c in np.flatnonzero(p < most_p):
            item, half = self.coordinates[c], USUAL * scale[c]
            name = f"{item.name} from {item.other}" if item.other else item.name
            value, (low, high) = float(values[c]), (float(self.center[c] - half), float(self.center[c] + half))
            if item.kind == "distance":
                value, low, high = np.exp([value, low, high]).tolist()
            found.append(Surprise(item.about, name, value, (low, high), float(p[c])))
        return sorted(found, key=lambda one: one.p)

    def p_values(self, values: Array) -> Array:
        """Return how often (C,) chance alone is as far off; 1 where a value is not known."""
        off = np.abs(values - self.center)[:, None] / self.sigma
        p = (self.weight * 2 * ndtr(-off)).sum(axis=1)
        own = np.array([item.of_world for item in self.coordinates])
        p = np.where(own, np.minimum(p, _beyond(self.values, self.kept, values, self.least)), p)
        distance = np.array([item.kind == "distance" for item in self.coordinates])
        shown = np.where(self.kept, self.values, np.inf).min(axis=0)
        inside = distance & (values < np.log(INSIDE_M)) & (shown > np.log(INSIDE_M))
        p = np.where(np.isnan(values), 1.0, np.where(inside, np.minimum(p, INSIDE_P), p))
        level = p[: 3 * len(self.scenes.keys)].reshape(-1, 3)[:, :2]  # a view: what is odd in x and in y is odder
        both = np.maximum(level.prod(axis=1), LEAST_P)
        both *= 1 - np.log(both)  # Fisher's combined probability
        level[np.arange(len(level)), level.argmin(axis=1)] = np.minimum(level.min(axis=1), both)
        return p

    def exchanged(self, scene: Scene) -> list[tuple[str, str, float]]:
        """Return pairs of names, and the nats by which a scene is more probable with their objects exchanged."""
        plain = scene.by_name().only(self.scenes.keys)
        now, found = self._log_density(plain), []
        for one, other in combinations(range(len(plain.keys)), 2):
            order = list(range(len(plain.keys)))
            order[one], order[other] = other, one
            swapped = replace(plain, place=plain.place[order], turn=plain.turn[order])
            gain = self._log_density(swapped) - now
            found.append((plain.keys[one], plain.keys[other], gain))
        return found

    def _log_density(self, scene: Scene) -> float:
        """Return the log density of where each thing is in the world."""
        values = _values(scene, self.origin)
        own = np.array([item.of_world for item in self.coordinates]) & ~np.isnan(values)
        off = (values - self.center)[own, None] / self.sigma[own]
        return float(logsumexp(-(off**2) / 2 - np.log(self.sigma[own]), b=self.weight[own] + _TINY, axis=1).sum())


_TINY = 1e-9


def _falling(second: float) -> Array:
    """Return the prior of spreads that are mostly the least one."""
    return np.array([1.0, *(second / GRADES[:-1])])


_LEAST: dict[Kind, float] = {
    "level": POSE_M, "height": POSE_M, "tilt": POSE_RAD, "yaw": POSE_RAD, "distance": LEAST_LOG,
    "hand place": HAND_M, "hand tilt": HAND_RAD, "hand yaw": HAND_RAD,
}  # fmt: skip
_PRIOR: dict[Kind, Sequence[float] | Array] = {
    "level": ANYWHERE, "yaw": ANYWHERE, "distance": ANYWHERE, "height": _falling(FIXED), "tilt": _falling(FIXED),
    "hand place": _falling(LEFT), "hand tilt": _falling(LEFT), "hand yaw": _falling(LEFT),
}  # fmt: skip


def _coordinates(scenes: Scene) -> tuple[Coordinate, ...]:
    """Return what `_values` has, in its order."""
    keys = scenes.keys
    found = [Coordinate(key, axis, "height" if axis == "z" else "level") for key in keys for axis in "xyz"]
    found += [Coordinate(key, f"tilt {axis}", "tilt") for key in keys for axis in "xyz"]
    found += [Coordinate(key, "yaw", "yaw") for key in keys]
    found += [Coordinate(ALL, "z", "height")]
    for one, other in combinations(keys, 2):
        found += [Coordinate(one, "distance", "distance", other)]
        found += [Coordinate(one, axis, "height" if axis == "z" else "level", other) for axis in "xyz"]
    for one, other in permutations(keys, 2):
        found += [Coordinate(one, f"own {axis}", "level", other) for axis in "xy"]
    found += [Coordinate(HAND, axis, "hand place") for axis in "xyz"]
    found += [Coordinate(HAND, f"tilt {axis}", "hand tilt") for axis in "xyz"]
    return (*found, Coordinate(HAND, "yaw", "hand yaw"))


def _origins(scenes: Scene) -> Array:
    """Return the circular means (K + 1,) of the yaws of N scenes' objects and hands."""
    yaws = np.column_stack([turns.yaw(scenes.turn), turns.yaw(scenes.start_turn)])
    fold = np.append(_folds(scenes), 1.0)
    mean: Array = np.angle(np.exp(1j * fold * yaws).sum(axis=0)) / fold
    return mean


def _folds(scene: Scene) -> Array:
    """Return how often (K,) in a turn each object looks the same."""
    return np.array([360 / period if period else 1.0 for period in scene.symmetry])


def _values(scene: Scene, origin: Array) -> Array:
    """Return the coordinates (..., C) of scenes (...); NaN where they mean nothing or are not known."""
    shape, k = scene.shape, len(scene.keys)
    fold, round_ = _folds(scene), np.array([period == 0 for period in scene.symmetry], dtype=bool)
    yaw = turns.wrapped(fold * (turns.yaw(scene.turn) - origin[:-1])) / fold
    parts = [
        scene.place.reshape(*shape, 3 * k),
        turns.rotated(scene.turn, turns.UP).reshape(*shape, 3 * k),
        np.where(round_, np.nan, yaw),
        scene.place[..., 2].min(axis=-1, keepdims=True),
    ]
    for one, other in combinations(range(k), 2):
        way = scene.place[..., one, :] - scene.place[..., other, :]
        far = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), LEAST_M)
        parts += [np.log(far), way]
    back = turns.inverse(turns.about_z(turns.yaw(scene.turn)))
    for one, other in permutations(range(k), 2):
        own = turns.rotated(back[..., other, :], scene.place[..., one, :] - scene.place[..., other, :])[..., :2]
        parts.append(own if scene.symmetry[other] is None else np.full_like(own, np.nan))
    up = turns.rotated(scene.start_turn, turns.UP)
    hand_yaw = turns.wrapped(turns.yaw(scene.start_turn) - origin[-1])[..., None]
    return np.concatenate([*parts, scene.start, up, hand_yaw], axis=-1)


def _kept(values: Array, least: Array) -> npt.NDArray[np.bool_]:
    """Return which values (N, C) are not in another world than the others."""
    number, known = len(values), ~np.isnan(values)
    if number < 3:
        return known
    found = known.copy()
    for n in range(number):
        others = np.delete(values, n, axis=0)
        found[n] &= _beyond(others, np.delete(known, n, axis=0), values[n], least) > FAR_P
    return np.where(found.any(axis=0), found, known)


def _beyond(values: Array, kept: npt.NDArray[np.bool_], value: Array, least: Array) -> Array:
    """Return the p (C,) of values as far outside of the range of N values drawn evenly from an unknown one."""
    number = kept.sum(axis=0)
    low = np.where(kept, values, np.inf).min(axis=0) - USUAL * least
    high = np.where(kept, values, -np.inf).max(axis=0) + USUAL * least
    out = np.maximum(np.maximum(low - value, value - high), 0.0)
    p = 2 / (number + 1) * (1 + out / np.maximum(high - low, least)) ** (1.0 - number)
    return np.where(out > 0, p, 1.0)


def repeated(shown: Scene, asked: Scene, scenes: int) -> list[tuple[str, str]]:
    """Return objects and what of them is measured exactly twice, which no density gives a probability.

    Continuous measurements never are: old pictures, missing sensors.

    Args:
        shown: the demonstrated scenes; `scenes`: how many.
    """
    found = []
    plain = asked.by_name().only(shown.keys)
    for k, name in enumerate(shown.keys):
        places, here = shown.place[:, k], plain.place[k]
        if scenes > 1 and np.ptp(places, axis=0).max() >= EXACT and (np.abs(places - here).max(axis=1) < EXACT).any():
            found.append((name, "stands exactly where it stood in a demonstration"))
        measured = np.concatenate([shown.measured[:, k], plain.measured[k : k + 1]])
        unturned = np.abs(measured[:, :3]).max(axis=1) < EXACT
        if shown.symmetry[k] != 0 and unturned.any() and not unturned.all():
            found.append((name, "has a rotation of exactly none in some scenes"))
    for one, other in combinations(range(len(shown.keys)), 2):
        if np.abs(plain.place[one] - plain.place[other]).max() < EXACT:
            found.append((shown.keys[one], f"stands exactly where {shown.keys[other]} stands"))
    return found
