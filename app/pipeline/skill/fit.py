"""Recordings of one form of instruction -> plans: aligned, seen from frames that explain them, parted by ways."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from app.pipeline.keyframes.motion import M_PER_RAD
from app.pipeline.keyframes.path import TOLERANCE_DEG, TOLERANCE_M
from app.pipeline.skill import turns
from app.pipeline.skill.alike import Turned, as_shown, turned_alike
from app.pipeline.skill.choice import choose
from app.pipeline.skill.evidence import log_about_zero
from app.pipeline.skill.recording import Costs, Recording, Rows, aligned, at_keyframes, counts_of
from app.pipeline.skill.rows import Row, placed
from app.pipeline.skill.scene import Scene
from app.pipeline.skill.ways import LEAST, Condition, split, told_apart
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

ROUNDS = 2  # of aligning recordings to the rows of all
NEEDED = 5.0  # log odds, in nats, that a row is needed before anything is compared: each bends a recorded path
STARTS = 3  # recordings whose stages are tried for those of all


@dataclass(frozen=True, eq=False)
class Plan:
    """One way of carrying out an instruction.

    Attributes:
        rows: each in its frame.
        members: the recordings that go this way; `shown`: their rows, symmetric things turned alike.
        when: the scenes that call for it; empty: all that call for no other.
    """

    rows: tuple[Row, ...]
    members: tuple[Recording, ...]
    shown: Rows
    when: tuple[Condition, ...] = ()

    def followed_by(self, k: int) -> str:
        """Return the names of the objects that row k follows in the first recording, or the world."""
        scene = self.members[0].scene
        names = dict(zip(scene.keys, scene.names, strict=True))
        return " and ".join(sorted(names[key] for key in self.rows[k].frame.objects)) or "the world"

    def holds(self, scene: Scene) -> bool:
        """Return whether a scene calls for the plan."""
        return all(condition.holds(scene) for condition in self.when)

    def at(self, scene: Scene) -> list[EndEffectorAction]:
        """Return the rows in a scene."""
        places, hands = placed(self.rows, self.as_shown(scene))
        return EndEffectorAction.many(places, hands, self.shown.gripper_open.tolist())

    def as_shown(self, scene: Scene) -> Scene:
        """Return a scene with what looks alike turned as in the recordings."""
        return as_shown(scene, self.shown, self.rows)


def plans_of(recordings: Sequence[Recording]) -> tuple[Plan, ...]:
    """Return the plans of recordings, the usual one first of those that no condition tells apart.

    Where their rule gives the keyframes, recordings with the same switches in as many keyframes have one plan.
    """
    if not recordings[0].rule.aligned:
        return tuple(_as_they_are(recordings))
    often = Counter(item.signature for item in recordings).most_common()
    usual = [item for item in recordings if item.signature == often[0][0]]
    others = [[item for item in recordings if item.signature == signature] for signature, _ in often[1:]]
    called_for: list[Plan] = []
    never: list[Plan] = []
    when: tuple[Condition, ...] = ()
    for group in others:
        if len(group) >= LEAST and (conditions := _between(usual, group)):
            called_for += _parted(group, conditions[1:])
            when = (*when, conditions[0])
        else:
            never += _parted(group, ())
    return (*called_for, *_parted(usual, when), *never)


def _as_they_are(recordings: Sequence[Recording]) -> Iterator[Plan]:
    states = [tuple(action.gripper_open for action in item.demonstration.actions) for item in recordings]
    for state, _ in Counter(states).most_common():
        alike = tuple(item for item, own in zip(recordings, states, strict=True) if own == state)
        yield plan_at_keyframes(alike)


def plan_at_keyframes(members: Sequence[Recording]) -> Plan:
    """Return the plan of recordings with equally many actions, which are its rows."""
    rows = at_keyframes([item.demonstration for item in members], [item.scene for item in members])
    return Plan(choose(rows) if len(rows) else (), tuple(members), rows)


def _between(usual: Sequence[Recording], group: Sequence[Recording]) -> tuple[Condition, Condition] | None:
    """Return the conditions of recordings with the usual switches of the gripper, and of others."""
    shared = set.intersection(*(set(item.scene.keys) for item in (*usual, *group)))
    scenes = Scene.stacked([item.scene for item in (*usual, *group)], sorted(shared))
    second = np.arange(len(usual) + len(group)) >= len(usual)
    found = told_apart(scenes, second)
    return None if found is None else found.conditions


def _parted(members: Sequence[Recording], when: tuple[Condition, ...]) -> Iterator[Plan]:
    """Yield the plans of recordings with the same switches of the gripper."""
    plan = _one_way(tuple(members), when)
    found = split(plan.shown.scenes, plan.rows)
    if found is None:
        yield plan
        return
    for side, condition in zip((False, True), found.conditions, strict=True):
        own = [item for item, second in zip(members, found.second, strict=True) if second == side]
        yield from _parted(own, (*when, condition))


def _one_way(members: tuple[Recording, ...], when: tuple[Condition, ...]) -> Plan:
    counts, resting = counts_of(members)
    rows = aligned(members, counts)
    alike = turned_alike(rows)
    rows = alike.of(rows)
    fitted = choose(rows)
    if not resting:
        if len(members) > 1:
            starts = [fitted, *_single(fitted, len(members))]
            found = [_realigned(members, counts, alike, start) for start in starts]
            rows, fitted = max(found, key=lambda one: sum(row.log_evidence for row in one[1]))
        rows, fitted = _without_vague(rows, fitted, set((np.cumsum(counts) - 1).tolist()))
    return Plan(fitted, members, rows, when)


def _realigned(
    members: Sequence[Recording], counts: Sequence[int], alike: Turned, fitted: tuple[Row, ...]
) -> tuple[Rows, tuple[Row, ...]]:
    for _ in range(ROUNDS):
        rows = alike.of(aligned(members, counts, _costs(members, alike, fitted)))
        fitted = choose(rows)
    return rows, fitted


def _single(fitted: Sequence[Row], number: int) -> Iterator[tuple[Row, ...]]:
    """Yield rows that are where one recording has them, so that stages of recordings do not mix."""
    for n in np.linspace(0, number - 1, min(STARTS, number)).astype(int):
        yield tuple(replace(row, place=row.place + row.residuals[:3, n]) for row in fitted)


def _costs(members: Sequence[Recording], alike: Turned, fitted: Sequence[Row]) -> Costs:
    where = [placed(fitted, alike.scenes.one(n)) for n in range(len(members))]

    def costs(n: int, k: int, frames: npt.NDArray[np.int_]) -> Array:
        trajectory, (places, hands) = members[n].motion.trajectory, where[n]
        hand = turns.product(hands[k], turns.HALF_TURN) if alike.halves[n] else hands[k]
        off_m = np.linalg.norm(trajectory.positions_m[frames] - places[k], axis=1)
        off: Array = (off_m + M_PER_RAD * turns.angle(trajectory.quaternions_xyzw[frames], hand)) / TOLERANCE_M
        return off

    return costs


def _without_vague(rows: Rows, fitted: tuple[Row, ...], ends: set[int]) -> tuple[Rows, tuple[Row, ...]]:
    """Return the rows that explain where recorded hands are better than straight ways; with each phase's last one.

    Without a row the hand moves straight from the row before to the row after. What is off by less than the tolerance
    of keyframes is as good as exact, for both.
    """
    kept = list(range(len(rows)))
    while True:
        few = rows.taking(kept)
        off = [_tolerant(fitted[k].residuals) for k in kept]
        gains = [-np.inf if k in ends else straight(few, i) - off[i] for i, k in enumerate(kept)]
        if max(gains) <= NEEDED:
            break
        del kept[int(np.argmax(gains))]
    if len(kept) == len(rows):
        return rows, fitted
    rows = rows.taking(kept)
    return rows, choose(rows)


def straight(rows: Rows, k: int) -> float:
    """Return the log evidence of recorded hands at row k by straight motion between its neighbors."""
    before, turn_before = rows.first, rows.first_turn
    if k:
        before, turn_before = rows.hand[:, k - 1], rows.turn[:, k - 1]
    here, after = rows.hand[:, k], rows.hand[:, k + 1]
    way = after - before
    share = ((here - before) * way).sum(1) / np.maximum((way**2).sum(1), TOLERANCE_M**2)
    share = np.clip(share, 0, 1)[:, None]
    off_m = here - before - share * way
    turning = turns.log(turns.product(turns.inverse(turn_before), rows.turn[:, k + 1]))
    on_way = turns.product(turn_before, turns.exp(share * turning))
    off_rad = turns.log(turns.product(turns.inverse(on_way), rows.turn[:, k]))
    return _tolerant(np.concatenate([off_m.T, off_rad.T]))


def _tolerant(residuals: Array) -> float:
    """Return the log evidence of residuals (6, N) about zero, with the tolerance of keyframes as noise."""
    floors = TOLERANCE_M, np.radians(TOLERANCE_DEG)
    squares = (residuals**2).sum(axis=1)
    parts = zip((squares[:3], squares[3:]), floors, strict=True)
    return float(sum(log_about_zero(of, residuals.shape[1], floor).sum() for of, floor in parts))
