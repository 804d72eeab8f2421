"""Several ways of doing a thing, and the quantity of a scene that says which: a recursive mixture, as a tree of cuts.

MiDiGaP (arXiv 2505.03296) keeps the modes of demonstrated trajectories apart; here a further way must explain more than
it costs, and a way that a scene can call for has a condition. Two kinds of parts are tried with the same evidence:
recordings whose residuals agree better in two parts than in one, and recordings that switch the gripper otherwise.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import betaln

from app.pipeline.skill import turns
from app.pipeline.skill.choice import FLOOR_M, FLOOR_RAD, WIDTH_M, WIDTH_RAD
from app.pipeline.skill.evidence import posterior
from app.pipeline.skill.rows import Row
from app.pipeline.skill.scene import Scene
from roboprompt_client.types.arrays import Array

LEAST = 3  # recordings of a way: fewer fix no frame
WORTH = 20.0  # nats that two ways must explain more than one: right recordings of one way stay below it
TOLD = 4.0  # nats by which a quantity must tell ways apart, beyond the choice of the quantity: chance often does
VARIES = 5  # floors by which a quantity must vary to tell ways apart
MOST_FLOORS = 20  # residuals farther out part no better
JEFFREYS = 0.5  # of the share of a way on one side of a cut

Which = npt.NDArray[np.bool_]


class Quantity(NamedTuple):
    """A number of a scene: a coordinate of an object, in the world or from another object, or its yaw."""

    coordinate: Literal["x", "y", "z", "yaw"]
    one: str
    other: str = ""

    def of(self, scenes: Scene) -> Array:
        """Return its values (...) in scenes (...), in m or rad."""
        k = scenes.keys.index(self.one)
        if self.coordinate == "yaw":
            return turns.yaw(scenes.turn[..., k, :])
        way = scenes.place[..., k, :]
        if self.other:
            way = way - scenes.place[..., scenes.keys.index(self.other), :]
        found: Array = way[..., "xyz".index(self.coordinate)]
        return found


@dataclass(frozen=True)
class Condition:
    """A way is taken where a quantity of the scene is beyond a cut.

    Attributes:
        above: on which side.
        between: the nearest values of recordings on both sides: which way it is there is a guess.
    """

    quantity: Quantity
    cut: float
    above: bool
    between: tuple[float, float]

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of the objects that it depends on."""
        return tuple(filter(None, (self.quantity.one, self.quantity.other)))

    @property
    def described(self) -> str:
        """In words, as `x of cup > 0.21`; keys of objects for their names."""
        seen_from = f" from {self.quantity.other}" if self.quantity.other else ""
        side = ">" if self.above else "<"
        return f"{self.quantity.coordinate} of {self.quantity.one}{seen_from} {side} {self.cut:.3g}"

    def holds(self, scene: Scene) -> bool:
        """Return whether a scene calls for the way."""
        return (float(self.quantity.of(scene)) > self.cut) == self.above

    def is_clear(self, scene: Scene) -> bool:
        """Return whether recordings on the same side have the scene between them and the cut."""
        low, high = self.between
        return not low < float(self.quantity.of(scene)) < high


class Split(NamedTuple):
    """Recordings in two parts.

    Attributes:
        second: (N,) who goes the second way.
        conditions: of the first and of the second way.
    """

    second: Which
    conditions: tuple[Condition, Condition]


def split(scenes: Scene, fitted: Sequence[Row]) -> Split | None:
    """Return two ways whose residuals agree better each on its own, if a quantity of the scene tells them apart."""
    residuals = np.stack([row.residuals for row in fitted])  # (R, 6, N)
    gain, second = two_kinds(residuals, LEAST)
    return told_apart(scenes, second) if gain > WORTH else None


def two_kinds(residuals: Array, least: int) -> tuple[float, Which]:
    """Return the nats by which two kinds explain residuals (R, 6, N) better than one, and who is of the second.

    The kinds are parted along the first two principal components of the residuals; each has `least` members.
    """
    number = residuals.shape[-1]
    nobody = np.zeros(number, dtype=bool)
    if number < max(2 * least, LEAST):
        return 0.0, nobody
    scaled = (residuals / (3 * np.repeat([FLOOR_M, FLOOR_RAD], 3))[:, None]).reshape(-1, number)
    scaled = np.clip(scaled - np.median(scaled, axis=1, keepdims=True), -MOST_FLOORS, MOST_FLOORS)
    _, _, along = np.linalg.svd(scaled - scaled.mean(axis=1, keepdims=True), full_matrices=False)
    best, who, one = 0.0, nobody, evidence(residuals)
    for direction in along[:2]:
        order = np.argsort(direction)
        for cut in range(least, number - least + 1):
            second = nobody.copy()
            second[order[cut:]] = True
            gains = evidence(residuals[..., second]) + evidence(residuals[..., ~second]) - one - np.log(2)
            gain = float(np.maximum(gains, 0).sum()) - number * np.log(2)
            if gain > best:
                best, who = gain, second
    return best, who


def told_apart(scenes: Scene, second: Which) -> Split | None:
    """Return the cut of a quantity that tells recordings of another kind from the others; None where none does.

    The kind on each side of the cut is Bernoulli distributed with Jeffreys' prior: its evidence is a ratio of beta
    functions.
    """

    def of(which: Which) -> float:
        return float(betaln(which.sum() + JEFFREYS, (~which).sum() + JEFFREYS) - betaln(JEFFREYS, JEFFREYS))

    cuts, number = _cuts(scenes)
    gains = [(of(second[cut.second]) + of(second[~cut.second]) - of(second), cut) for cut in cuts]
    gain, best = max(gains, key=lambda one: one[0], default=(0.0, None))
    if best is None or gain < TOLD + np.log(number):
        return None
    above = 2 * int((second & best.second).sum()) > int(best.second.sum())
    first, other = best.conditions
    return Split(second, (first, other) if above else (other, first))


def evidence(residuals: Array) -> Array:
    """Return the log evidence (R, 6) of residuals (R, 6, N)."""
    place = posterior(residuals[:, :3], FLOOR_M, WIDTH_M).log_evidence
    return np.concatenate([place, posterior(residuals[:, 3:], FLOOR_RAD, WIDTH_RAD).log_evidence], axis=1)


def _cuts(scenes: Scene) -> tuple[list[Split], int]:
    """Return every division of N scenes by a quantity, each by that which divides it most clearly; how many vary."""
    best: dict[bytes, tuple[float, Split]] = {}
    varying = 0
    for quantity in _quantities(scenes.keys):
        values = quantity.of(scenes)
        order = np.argsort(values)
        ascending, reach = values[order], float(np.ptp(values))
        if reach < VARIES * FLOOR_M:
            continue
        varying += 1
        for n in range(1, len(values)):
            second = np.zeros(len(values), dtype=bool)
            second[order[n:]] = True
            gap = float(ascending[n - 1]), float(ascending[n])
            margin, cut = (gap[1] - gap[0]) / reach, sum(gap) / 2
            if margin > best.get(second.tobytes(), (0.0,))[0]:
                below, above = (Condition(quantity, cut, side, gap) for side in (False, True))
                best[second.tobytes()] = margin, Split(second, (below, above))
    return [found for _, found in best.values()], varying


def _quantities(keys: Sequence[str]) -> Iterator[Quantity]:
    for key in keys:
        yield from (Quantity("x", key), Quantity("y", key), Quantity("z", key), Quantity("yaw", key))
    for one, other in combinations(keys, 2):
        yield from (Quantity("x", other, one), Quantity("y", other, one), Quantity("z", other, one))
