"""Alignment of demonstrations: all of one plan get the same number of keyframes, at corresponding places.

Demonstrations with the same sequence of grasps and releases are cut into phases at these. In each phase all get equally
many keyframes. Dynamic programming chooses them, so that paths stay close to straight motion between keyframes, and
keyframes of the same number close together relative to their anchors. Each way of doing a task is a plan of its own.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import attrgetter

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.groups import places_by
from app.pipeline.keyframes import Keyframe
from app.pipeline.keyframes.resting import leave_path, paths_left_m
from app.pipeline.keyframes.rules import MAX_KEYFRAMES
from app.pipeline.plans.recording import Recording, choose, off_one, off_rows
from app.pipeline.plans.rows import PlanRow, plan_rows
from app.pipeline.plans.ways import other_way
from app.pipeline.thresholds import M_PER_RAD
from roboprompt_client.types.arrays import Array

PATH_KEPT_SHARE = 0.8  # of the demonstrations: their paths need no more keyframes than a phase gets
ROUNDS = 2  # of moving keyframes closer to those of the other demonstrations
AGREES_M = 0.01  # the scatter of a row whose keyframes certainly belong together
KEEPS_M = 0.002  # farther from the paths it must not leave them
STARTS = 4  # demonstrations that the alignment is initialized with where rows scatter
BETTER_SHARE = 0.8  # of the scatter: below it the other initialization is better
MOST = 2.0  # times as many recordings go on after the release with which one ends


def aligned(group: Sequence[Recording]) -> tuple[Demonstration, ...]:
    """Return the demonstrations with `plan` set; those of one plan have equally many actions.

    Args:
        group: recordings with the same form of instruction.
    """
    group = _ending_alike(group)
    by_signature = places_by(group, attrgetter("signature")).values()
    plans = [places for alike in by_signature for places in _by_grasped(group, alike)]
    found: dict[int, Demonstration] = {}
    for plan, places in enumerate(plans):  # the loop appends to `plans` what turns out to be another way
        while other := other_way(demonstrations := _of_one_signature([group[place] for place in places])):
            plans.append([places[k] for k in other])
            places = [place for k, place in enumerate(places) if k not in other]
        found |= {place: replace(shown, plan=plan) for place, shown in zip(places, demonstrations, strict=True)}
    return tuple(found[place] for place in range(len(group)))


def _ending_alike(group: Sequence[Recording]) -> list[Recording]:
    """Return the recordings, with a stay at the end of those that end with a release after which most others go on."""
    often = Counter(recording.signature for recording in group)
    found = []
    for recording in group:
        ends, last = recording.signature, recording.motion.phases[-1]
        releases = last.ends_open and not last.gripper_open
        found.append(replace(recording, stays=releases and MOST * often[ends] <= often[(*ends, True)]))
    return found


def _by_grasped(group: Sequence[Recording], places: Sequence[int]) -> list[list[int]]:
    """Return the recordings (by index) in groups that grasp the same objects in the same order.

    A grasp of an unknown object matches any. Recordings with the fewest of these come first, so that an ambiguous
    recording does not merge two different orders.
    """
    orders: list[tuple[list[int | None], list[int]]] = []
    for place in sorted(places, key=lambda place: group[place].grasped.count(None)):
        grasped = group[place].grasped
        found = next((one for one in orders if _same_order(one[0], grasped)), None)
        if found is None:
            orders.append((list(grasped), [place]))
        else:
            order, members = found
            order[:] = [known if one is None else one for one, known in zip(order, grasped, strict=True)]
            members.append(place)
    return sorted(sorted(members) for _, members in orders)


def _same_order(one: Sequence[int | None], other: Sequence[int | None]) -> bool:
    return all(None in pair or pair[0] == pair[1] for pair in zip(one, other, strict=True))


def _of_one_signature(members: Sequence[Recording]) -> list[Demonstration]:
    """Return demonstrations with equally many actions, from recordings with the same gripper switches.

    Recordings at rest keep the keyframes of their rule, unless motion between these leaves the recorded paths; then, as
    for all others, the paths determine how many keyframes each phase has.
    """
    resting = 2 * sum(member.manner == "rests" for member in members) > len(members)
    found = _with_numbers(members, _numbers([member.counts for member in members], most_frequent=resting), resting)
    left_m = [member.left_m(item.actions) for member, item in zip(members, found.demonstrations, strict=True)]
    if leave_path(left_m):
        on_path = _numbers([member.counts_on_path for member in members], most_frequent=False)
        if on_path != found.numbers:
            resting, found = False, _with_numbers(members, on_path, False)
    return found.demonstrations if resting else _without_vague(found)


def _without_vague(found: "_Alignment") -> list[Demonstration]:
    """Return the demonstrations without vague rows.

    Rows may be vague, or scatter, because keyframes of one number belong to different stages of the task. Then the
    alignment is repeated, initialized with the keyframes of one demonstration; where rows only scatter, and
    the gripper never switches, the best of several that keep the paths.
    """
    others: Iterable[_Alignment] = ()
    if found.vague:
        others = _after_one(found, 1)
    elif len(found.numbers) == 1 and max(found.scatter_m) > AGREES_M:  # no switch says which stage a keyframe is of
        most_m = found.left_m() + KEEPS_M
        others = (other for other in _after_one(found, STARTS) if other.left_m() < most_m)
    other = min(others, key=_Alignment.sum_m, default=found)
    found = other if other.sum_m() < BETTER_SHARE * found.sum_m() else found
    keyframes = [[own[k] for k in range(len(own)) if k not in found.vague] for own in found.keyframes]
    return replace(found, keyframes=keyframes).demonstrations


@dataclass(frozen=True, eq=False)
class _Alignment:
    """Recordings with equally many keyframes.

    Attributes:
        members: the N recordings.
        numbers: of keyframes in each phase.
        keyframes: [recording][row].
    """

    members: Sequence[Recording]
    numbers: tuple[int, ...]
    keyframes: Sequence[Sequence[Keyframe]]

    @cached_property
    def demonstrations(self) -> list[Demonstration]:
        """The demonstrations, with an action for each keyframe."""
        return [member.with_keyframes(own) for member, own in zip(self.members, self.keyframes, strict=True)]

    @cached_property
    def rows(self) -> tuple[PlanRow, ...]:
        """What each row is relative to, and how it scatters over the demonstrations."""
        return plan_rows(self.demonstrations)

    @cached_property
    def scatter_m(self) -> list[float]:
        """The median residual of each row; rotations count as meters."""
        return [float(np.median(row.off_m + M_PER_RAD * np.radians(row.off_deg))) for row in self.rows]

    def sum_m(self) -> float:
        """Return the scatter of all rows together."""
        return sum(self.scatter_m)

    def left_m(self) -> float:
        """Return the mean distance by which straight motion between the keyframes leaves the recorded paths."""
        pairs = zip(self.members, self.demonstrations, strict=True)
        return float(np.mean([max(paths_left_m(member.motion, shown.actions)) for member, shown in pairs]))

    @cached_property
    def vague(self) -> frozenset[int]:
        """The rows that scatter more than straight motion between their neighbors would deviate from the paths.

        Mostly such a row is half-way between two objects and has a constant offset from neither. The last row of a
        phase is never vague.
        """
        phases = [phase for phase, number in enumerate(self.numbers) for _ in range(number)]
        kept, left_m = list(range(len(phases))), np.zeros(len(self.members))
        while (worst := self._vaguest(kept, phases, left_m)) is not None:
            left_m = np.maximum(left_m, worst[1])
            kept.remove(worst[0])
        return frozenset(range(len(phases))) - frozenset(kept)

    def _vaguest(self, kept: Sequence[int], phases: Sequence[int], left_m: Array) -> tuple[int, Array] | None:
        """Return the kept row whose removal gains most, and the deviation (N,) from each path without it.

        None if no removal gains anything.

        Args:
            left_m: (N,) the deviation from each path without the rows that were removed before.
        """
        found, least_m = None, 0.0
        for before, k, after in zip([-1, *kept[:-1]], kept, kept[1:], strict=False):  # -1: the first frame
            if phases[k] != phases[after]:
                continue
            bends_m = self._bends_m(phases[k], before, after)
            beside_m = ((self.scatter_m[before] if before >= 0 else 0.0) + self.scatter_m[after]) / 2
            worth_m = float(np.median(bends_m)) + beside_m - self.scatter_m[k]
            if worth_m < least_m and not leave_path(np.maximum(left_m, bends_m).tolist()):
                found, least_m = (k, bends_m), worth_m
        return found

    def _bends_m(self, phase: int, before: int, after: int) -> Array:
        """Return the deviation (N,) of each path from straight motion between two keyframes of a phase."""
        bends_m = []
        for member, own in zip(self.members, self.keyframes, strict=True):
            path, start = member.paths[phase], own[before].frame if before >= 0 else 0
            first, last = np.searchsorted(path.frames, [start, own[after].frame])
            bends_m.append(member.rule.tolerance_m * path.deviations[first, last])
        return np.array(bends_m)


def _with_numbers(members: Sequence[Recording], numbers: tuple[int, ...], as_found: bool) -> _Alignment:
    """Return the recordings aligned with these numbers of keyframes in the phases.

    Args:
        as_found: whether recordings at rest that have these numbers keep their own keyframes.
    """
    keep = [
        as_found and member.manner == "rests" and member.counts == numbers and len(member.keyframes) == sum(numbers)
        for member in members
    ]
    chosen = [
        member.keyframes if keeps else choose(member, numbers, None)
        for member, keeps in zip(members, keep, strict=True)
    ]
    return _settled(_Alignment(members, numbers, chosen), keep)


def _after_one(found: _Alignment, starts: int) -> Iterator[_Alignment]:
    """Yield alignments initialized with the keyframes of one demonstration: those whose own numbers are nearest."""
    off = [sum(abs(one - other) for one, other in zip(m.counts, found.numbers, strict=True)) for m in found.members]
    for first in np.argsort(off, kind="stable")[:starts]:
        shown, keyframes = found.members[first], found.keyframes[first]
        chosen = [choose(each, found.numbers, partial(off_one, each, shown, keyframes)) for each in found.members]
        yield _settled(replace(found, keyframes=chosen), [False] * len(chosen))


def _settled(found: _Alignment, keep: Sequence[bool]) -> _Alignment:
    """Return the alignment after `ROUNDS` of choosing each recording's keyframes near those of the others.

    Args:
        keep: (N,) which recordings keep theirs.
    """
    for _ in range(ROUNDS if len(keep) > 1 and not all(keep) else 0):
        chosen = [
            own if keeps else choose(member, found.numbers, partial(off_rows, member, found.rows, place))
            for place, (member, keeps, own) in enumerate(zip(found.members, keep, found.keyframes, strict=True))
        ]
        found = replace(found, keyframes=chosen)
    return found


def _numbers(counts: Sequence[tuple[int, ...]], *, most_frequent: bool) -> tuple[int, ...]:
    """Return how many keyframes each phase gets, in all at most as many as a reply may have."""
    if most_frequent:
        return Counter(counts).most_common(1)[0][0]
    numbers = [math.ceil(np.quantile(column, PATH_KEPT_SHARE)) for column in zip(*counts, strict=True)]
    while sum(numbers) > max(MAX_KEYFRAMES, len(numbers)):
        numbers[int(np.argmax(numbers))] -= 1
    return tuple(numbers)
