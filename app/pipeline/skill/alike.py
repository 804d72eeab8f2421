"""Harmless hypotheses, which are applied: an object that looks alike after a turn, a hand that works either way.

People and pose estimators see one of several equal sides. Where the rows of all recordings gain evidence as an object
is turned by its period, or the hand by half a turn, they are turned; a new scene is turned as most recordings are.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app.pipeline.skill import turns
from app.pipeline.skill.choice import choose
from app.pipeline.skill.recording import Rows
from app.pipeline.skill.rows import Row, placed
from app.pipeline.skill.scene import Scene
from roboprompt_client.types.arrays import Array

CHANGED = -2.0  # log prior of a demonstration in which something is turned
LOOKS_ALIKE = -6.0  # log prior of an object that looks alike after a turn though nobody has told
PERIODS_DEG = (180, 120, 90)  # of objects of which nobody has told
CLEARLY_RAD = np.pi / 6  # less is no turn of a symmetric thing
FAR_RAD = 0.5  # rotations farther apart agree in nothing
RATHER_FIRST = 1e-3  # rad by which a later way to turn must be better
ROUNDS = 4  # turns that are found one after the other


class Turned(NamedTuple):
    """Recordings with their symmetric things turned alike.

    Attributes:
        scenes: with objects turned, and the symmetries that were found.
        halves: (N,) whether the hand is turned by half a turn.
    """

    scenes: Scene
    halves: npt.NDArray[np.bool_]

    def of(self, rows: Rows) -> Rows:
        """Return rows of the same recordings, turned alike."""
        turn = np.where(self.halves[:, None, None], turns.product(rows.turn, turns.HALF_TURN), rows.turn)
        return rows.turned(self.scenes, turn)


def turned_alike(rows: Rows) -> Turned:
    """Return the recordings turned so that the rows in which the hand acts have most evidence."""
    now = Turned(rows.scenes, np.zeros(rows.number, dtype=bool))
    if rows.number < 2 or not rows.scenes.keys:
        return now
    acts = rows.taking(rows.acts)
    total = _evidence(acts)
    for _ in range(ROUNDS):
        found = []
        for act, key, period in _maybe_alike(now.of(acts)):
            other, changes = _alike_at(now, acts, act, key, period)
            if changes:
                told = rows.scenes.symmetry[rows.scenes.keys.index(key)]
                prior = LOOKS_ALIKE if told is None and period is not None else CHANGED * changes
                found.append((_evidence(other.of(acts)) + prior, other))
        if not found or (best := max(found, key=lambda one: one[0]))[0] <= total:
            return now
        now = best[1]
        total = _evidence(now.of(acts))
    return now


def as_shown(scene: Scene, shown: Rows, fitted: tuple[Row, ...]) -> Scene:
    """Return a scene with what turned out to look alike turned so that the hand turns as it mostly did."""
    for act in shown.acts:
        key = fitted[act].frame.hand.one
        if key not in scene.keys or scene.symmetry[scene.keys.index(key)] is not None:
            continue
        if not (period := shown.scenes.symmetry[shown.scenes.keys.index(key)]):
            continue
        alike = [scene.turned(key, np.array(angle)) for angle in np.radians(np.arange(0, 360, period))]
        usual = turns.medoid(shown.turn[:, act])
        off = [float(turns.angle(placed([fitted[act]], one)[1][0], usual)) for one in alike]
        scene = alike[int(turns.first_least(off))]
    return scene


def _evidence(rows: Rows) -> float:
    return sum(row.log_evidence for row in choose(rows))


def _maybe_alike(acts: Rows) -> Iterator[tuple[int, str, float | None]]:
    """Yield rows, the object that is nearest to the hand there, and degrees after which it may look alike."""
    known: set[tuple[str, float | None]] = set()
    for act in range(len(acts)):
        away = np.linalg.norm(acts.scenes.place - acts.hand[:, act][:, None], axis=2)
        k = int(np.median(away, axis=0).argmin())
        key, told = acts.scenes.keys[k], acts.scenes.symmetry[k]
        for period in (told, *PERIODS_DEG) if told is None else (told,):
            if (key, period) not in known and (act == 0 or (period and told is None)):
                known.add((key, period))
                yield act, key, period


def _alike_at(now: Turned, plain: Rows, act: int, key: str, period: float | None) -> tuple[Turned, int]:
    """Return recordings in which hands (by half a turn) and an object that looks alike after `period` are turned alike.

    Also returns in how many something is turned. Rather the object is turned than the hand.
    """
    acts = now.of(plain)
    k = acts.scenes.keys.index(key)
    own_turns = np.radians(np.arange(0, 360, period)) if period else np.zeros(1)
    variants = [(angle, half) for half in ((False, True) if act == 0 else (False,)) for angle in own_turns]
    relative = np.array([_seen_from(acts, k, act, angle, half) for angle, half in variants])  # (V, N, 4)
    mean = turns.medoid(relative[0])
    if period and acts.scenes.symmetry[k] is None:  # each may show another side: the one that most can be turned to
        apart = [_apart(relative, relative[0, n]).min(axis=0).sum() for n in range(acts.number)]
        mean = relative[0, int(turns.first_least(apart))]
    away = turns.angle(relative, mean) + RATHER_FIRST * np.arange(len(variants))[:, None]
    which = away.argmin(axis=0)
    changed = away[0] - away.min(axis=0) > CLEARLY_RAD
    angles = np.where(changed, np.array([angle for angle, _ in variants])[which], 0.0)
    halves = changed & np.array([half for _, half in variants])[which]
    symmetry = tuple(
        period if other == key else of for other, of in zip(acts.scenes.keys, acts.scenes.symmetry, strict=True)
    )
    scenes = replace(acts.scenes.turned(key, angles), symmetry=symmetry)
    return Turned(scenes, now.halves ^ halves), int(changed.sum())


def _seen_from(acts: Rows, k: int, act: int, angle: float, half: bool) -> Array:
    """Return the hands (N, 4) in a row as an object sees them that is turned, as the hand may be by half a turn."""
    own = turns.product(acts.scenes.turn[:, k], turns.about_z(angle))
    hand = turns.product(acts.turn[:, act], turns.HALF_TURN) if half else acts.turn[:, act]
    return turns.product(turns.inverse(own), hand)


def _apart(turned: Array, other: Array) -> Array:
    return np.minimum(turns.angle(turned, other), FAR_RAD)
