"""The same number of keyframes in every demonstration of one plan, each at the place that it has in the others.

Demonstrations with the same sequence of grasps and releases are cut into phases at these; a phase has as many keyframes
in all of them, chosen so that the path stays close to straight motion and rows of different demonstrations lie close
together relative to what they follow. Each way of doing a thing is a plan, aligned by itself.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.keyframes import Keyframe
from app.pipeline.keyframes.path import HandPath, at_tips, best_waypoints
from app.pipeline.keyframes.resting import leave_path
from app.pipeline.keyframes.rule import MAX_KEYFRAMES, at_frames
from app.pipeline.plans.agreement import other_way
from app.pipeline.plans.recording import Recording
from app.pipeline.plans.rows import PlanRow, plan_rows
from app.pipeline.representation.anchors import M_PER_RAD, anchor_pose, tilted_objects
from roboprompt_client.types.arrays import Array

PATH_KEPT_SHARE = 0.8  # the share of demonstrations whose paths need no more keyframes than a phase gets
ROUNDS = 2  # of choosing keyframes where the other demonstrations have them
TOGETHER_WEIGHT = 0.3  # the weight of rows lying together, beside that of paths being kept, in squared tolerances
CLEARLY_LESS = 0.8  # of the scatter: keyframes that began elsewhere are taken instead
MAX_DISTANCE = 3.0  # in tolerances: what is farther from the others does not count more

Distances = Callable[[HandPath, int], Array]
"""(N,) how far each pose of a path is from where others have the keyframe of that number, in tolerances."""


def aligned(group: Sequence[Recording]) -> tuple[Demonstration, ...]:
    """The demonstrations, those of one plan with equally many actions; `plan` says which are of one plan.

    Args:
        group: recordings that ask for the same.
    """
    by_signature: dict[tuple[bool, ...], list[int]] = defaultdict(list)
    for place, recording in enumerate(group):
        by_signature[recording.signature].append(place)
    plans = [places for alike in by_signature.values() for places in _by_grasped(group, alike)]
    found: dict[int, Demonstration] = {}
    for plan, places in enumerate(plans):  # which grows by the other ways that are found
        while other := other_way(demonstrations := _of_one_signature([group[place] for place in places])):
            plans.append([places[k] for k in other])
            places = [place for k, place in enumerate(places) if k not in other]
        found |= {place: replace(shown, plan=plan) for place, shown in zip(places, demonstrations, strict=True)}
    return tuple(found[place] for place in range(len(group)))


def _by_grasped(group: Sequence[Recording], places: Sequence[int]) -> list[list[int]]:
    """Recordings that grasp the same objects in the same order together; what is not clear fits any.

    Those that are clear come first, so that one that is not does not bring two orders together.
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
    """With the keyframes of the recordings' rule; where these lose their paths, with as many as the paths need."""
    resting = 2 * sum(member.manner == "rests" for member in members) > len(members)
    found = _with_numbers(members, _numbers([member.counts for member in members], most_frequent=resting), resting)
    on_path = _numbers([member.counts_on_path for member in members], most_frequent=False)
    left_m = [member.left_m(item.actions) for member, item in zip(members, found.demonstrations, strict=True)]
    if on_path != found.numbers and leave_path(left_m):
        resting, found = False, _with_numbers(members, on_path, False)
    return found.demonstrations if resting else _without_vague(found)


def _without_vague(found: "_Alignment") -> list[Demonstration]:
    """The demonstrations without vague rows.

    Where rows are vague, keyframes of one number may be different stages of the task: then it is tried again, from the
    keyframes of one demonstration.
    """
    if found.vague and sum((other := _after_one(found)).scatter_m) < CLEARLY_LESS * sum(found.scatter_m):
        found = other
    keyframes = [[own[k] for k in range(len(own)) if k not in found.vague] for own in found.keyframes]
    return replace(found, keyframes=keyframes).demonstrations


@dataclass(frozen=True, eq=False)
class _Alignment:
    """Recordings with equally many keyframes.

    Attributes:
        numbers: of keyframes in each phase.
        keyframes: of each recording.
    """

    members: Sequence[Recording]
    numbers: tuple[int, ...]
    keyframes: Sequence[Sequence[Keyframe]]

    @cached_property
    def demonstrations(self) -> list[Demonstration]:
        """With the actions of the keyframes."""
        return [member.with_keyframes(own) for member, own in zip(self.members, self.keyframes, strict=True)]

    @cached_property
    def rows(self) -> tuple[PlanRow, ...]:
        """Of the demonstrations."""
        return plan_rows(self.demonstrations)

    @cached_property
    def scatter_m(self) -> list[float]:
        """Of each row, rotations as meters."""
        return [float(np.median(row.off_m + M_PER_RAD * np.radians(row.off_deg))) for row in self.rows]

    @cached_property
    def vague(self) -> frozenset[int]:
        """Rows without which the others tell better where the hand goes.

        Mostly such a row is on the way from one thing to another and follows neither. Those that end a phase stay.
        """
        phases = [phase for phase, number in enumerate(self.numbers) for _ in range(number)]
        kept, left_m = list(range(len(phases))), np.zeros(len(self.members))
        while (worst := self._vaguest(kept, phases, left_m)) is not None:
            left_m = np.maximum(left_m, worst[1])
            kept.remove(worst[0])
        return frozenset(range(len(phases))) - frozenset(kept)

    def _vaguest(self, kept: Sequence[int], phases: Sequence[int], left_m: Array) -> tuple[int, Array] | None:
        """Of the rows that are kept the one that can best be missed, and how far the paths are left without it.

        Args:
            left_m: (N,) how far the paths are left without those that are not kept.
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
        """(N,) how far each path is from straight motion from one keyframe to another of the phase."""
        bends_m = []
        for member, own in zip(self.members, self.keyframes, strict=True):
            path, start = member.paths[phase], own[before].frame if before >= 0 else 0
            first, last = np.searchsorted(path.frames, [start, own[after].frame])
            bends_m.append(member.rule.tolerance_m * path.deviations[first, last])
        return np.array(bends_m)


def _with_numbers(members: Sequence[Recording], numbers: tuple[int, ...], as_found: bool) -> _Alignment:
    """With so many keyframes in each phase.

    Args:
        as_found: whether recordings that rest at so many keep their own.
    """
    keep = [
        as_found and member.manner == "rests" and member.counts == numbers and len(member.keyframes) == sum(numbers)
        for member in members
    ]
    chosen = [
        member.keyframes if keeps else _chosen(member, numbers, None)
        for member, keeps in zip(members, keep, strict=True)
    ]
    return _settled(_Alignment(members, numbers, chosen), keep)


def _after_one(found: _Alignment) -> _Alignment:
    """Aligned from where the demonstration has its keyframes whose path needs most nearly as many."""
    off = [sum(abs(one - other) for one, other in zip(m.counts, found.numbers, strict=True)) for m in found.members]
    first = int(np.argmin(off))
    shown, keyframes = found.members[first], found.keyframes[first]
    chosen = [_chosen(member, found.numbers, partial(_off_one, member, shown, keyframes)) for member in found.members]
    return _settled(replace(found, keyframes=chosen), [False] * len(chosen))


def _settled(found: _Alignment, keep: Sequence[bool]) -> _Alignment:
    """With keyframes chosen where the others have them.

    Args:
        keep: which recordings keep theirs.
    """
    for _ in range(ROUNDS if len(keep) > 1 and not all(keep) else 0):
        chosen = [
            own if keeps else _chosen(member, found.numbers, partial(_off_rows, member, found.rows, place))
            for place, (member, keeps, own) in enumerate(zip(found.members, keep, found.keyframes, strict=True))
        ]
        found = replace(found, keyframes=chosen)
    return found


def _numbers(counts: Sequence[tuple[int, ...]], *, most_frequent: bool) -> tuple[int, ...]:
    """How many keyframes each phase gets, as many as a reply may have in all."""
    if most_frequent:
        return Counter(counts).most_common(1)[0][0]
    numbers = [math.ceil(np.quantile(column, PATH_KEPT_SHARE)) for column in zip(*counts, strict=True)]
    while sum(numbers) > max(MAX_KEYFRAMES, len(numbers)):
        numbers[int(np.argmax(numbers))] -= 1
    return tuple(numbers)


def _chosen(recording: Recording, numbers: Sequence[int], distances: Distances | None) -> list[Keyframe]:
    """Keyframes as many as wanted in each phase.

    Args:
        distances: from the others, to lie near to them; None: its own path alone decides.
    """
    found: list[Keyframe] = []
    for phase, path, number in zip(recording.motion.phases, recording.paths, numbers, strict=True):
        if number == 1:  # its end: no other pose is weighed
            found += at_frames(phase, [phase.last])
            continue
        costs = None
        if distances is not None:
            off = np.array([distances(path, k) for k in range(len(found), len(found) + number)])
            costs = TOGETHER_WEIGHT * np.minimum(off, MAX_DISTANCE) ** 2
        frames = [int(path.frames[k]) for k in best_waypoints(path.deviations, number, costs)]
        if distances is None:
            frames = at_tips(recording.motion.trajectory.positions_m, phase.first, frames, recording.rule.tolerance_m)
        found += at_frames(phase, frames)
    return found


def _off_rows(recording: Recording, rows: Sequence[PlanRow], place: int, path: HandPath, k: int) -> Array:
    """`Distances` from the rows of demonstrations, among which the recording has this place."""
    demonstration, row = recording.demonstration, rows[k]
    origin = anchor_pose(row.anchors[place], demonstration, tilted_objects([demonstration]))
    trajectory = recording.motion.trajectory
    hands = Rotation.from_quat(trajectory.quaternions_xyzw[path.frames])
    offsets_m, rotations = origin.seen(trajectory.positions_m[path.frames], hands)
    off_m = np.linalg.norm(offsets_m - row.center_m, axis=1)
    off_m += M_PER_RAD * (row.mean_rotation.inv() * rotations).magnitude()
    distances: Array = off_m / recording.rule.tolerance_m
    return distances


def _off_one(recording: Recording, shown: Recording, keyframes: Sequence[Keyframe], path: HandPath, k: int) -> Array:
    """`Distances` from the keyframes of one demonstration, seen from the world or the object where they are least."""
    places_m = recording.motion.trajectory.positions_m[path.frames]
    shown_m = shown.motion.trajectory.positions_m[keyframes[k].frame]
    objects = zip(recording.demonstration.ordered_objects, shown.demonstration.ordered_objects, strict=True)
    moved_m = np.array([np.zeros(3), *(here.position_m - there.position_m for here, there in objects)])
    off_m = np.linalg.norm(places_m - (shown_m + moved_m)[:, None], axis=2).min(axis=0)
    distances: Array = off_m / recording.rule.tolerance_m
    return distances
