"""The same number of keyframes in every demonstration of one plan, each at the place that it has in the others.

Demonstrations with the same sequence of grasps and releases are cut into phases at these; a phase has as many keyframes
in all of them, chosen so that the path stays close to straight motion and rows of different demonstrations lie close
together relative to what they follow.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.keyframes import Keyframe, KeyframeRule, Manner, Motion, find_keyframes, manner_of
from app.pipeline.keyframes.path import HandPath, at_tips, best_waypoints
from app.pipeline.keyframes.resting import leave_path, path_left_m
from app.pipeline.keyframes.rule import MAX_KEYFRAMES, at_frames, waypoints
from app.pipeline.plans.rows import PlanRow, plan_rows
from app.pipeline.representation.anchors import M_PER_RAD, anchor_pose, tilted_objects
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import EndEffectorAction

PATH_KEPT_SHARE = 0.8  # the share of demonstrations whose paths need no more keyframes than a phase gets
GRASPED_M = 0.08  # a hand that closes within this of an object grasps it,
CLEARLY = 2.0  # if all others are so many times as far
ROUNDS = 2  # of choosing keyframes where the other demonstrations have them
TOGETHER_WEIGHT = 0.3  # the weight of rows lying together, beside that of paths being kept, in squared tolerances
MAX_DISTANCE = 3.0  # in tolerances: what is farther from the others does not count more


@dataclass(frozen=True, eq=False)
class Recording:
    """A demonstration with the motion that it was made from."""

    demonstration: Demonstration
    motion: Motion
    rule: KeyframeRule

    @cached_property
    def manner(self) -> Manner:
        """How the recording moves."""
        if self.rule.rule == "waypoints":
            return "flows"
        return manner_of(self.motion, self.rule.delta_rad_s)

    @cached_property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """Its own, whatever the others have; by waypoints where the rule skips one of several switches in a rest."""
        found = find_keyframes(self.motion, self.rule)
        if len(self._counts_of(found)) == len(self.motion.phases):
            return found
        return self._waypoints

    @cached_property
    def _waypoints(self) -> tuple[Keyframe, ...]:
        return waypoints(self.motion, self.rule.tolerance_m, self.rule.tolerance_deg)

    @cached_property
    def paths(self) -> tuple[HandPath, ...]:
        """Of each phase."""
        tolerances = (self.rule.tolerance_m, self.rule.tolerance_deg)
        return tuple(self.motion.path(phase.first, phase.last, *tolerances) for phase in self.motion.phases)

    @property
    def counts(self) -> tuple[int, ...]:
        """Its own keyframes in each phase: the last of a phase is where the gripper switches."""
        by_switches = self._counts_of(self.keyframes)
        if len(by_switches) == len(self.motion.phases):
            return by_switches
        # Keyframes that show other switches than there are are counted by time.
        frames = [keyframe.frame for keyframe in self.keyframes]
        return tuple(max(1, sum(phase.first < frame <= phase.last for frame in frames)) for phase in self.motion.phases)

    def _counts_of(self, keyframes: Sequence[Keyframe]) -> tuple[int, ...]:
        counts, state = [0], bool(self.motion.phases[0].gripper_open)
        for keyframe in keyframes:
            counts[-1] += 1
            if keyframe.gripper_open != state:
                counts.append(0)
                state = keyframe.gripper_open
        return tuple(counts if counts[-1] else counts[:-1])

    @cached_property
    def counts_on_path(self) -> tuple[int, ...]:
        """As many keyframes in each phase as its path needs, whether it rests or not."""
        return self._counts_of(self._waypoints)

    def left_m(self, actions: Sequence[EndEffectorAction]) -> float:
        """How far the way through these actions leaves its path where that matters."""
        return path_left_m(self.motion, self.manner, actions)

    @property
    def signature(self) -> tuple[bool, ...]:
        """What the gripper does, in order."""
        return (self.motion.phases[0].gripper_open, *(phase.ends_open for phase in self.motion.phases))

    @cached_property
    def grasped(self) -> tuple[int | None, ...]:
        """Of each grasp the object that the hand closes on, by its place in the order of mention; None: not clear.

        Where objects stand is known before the first action: one that was moved is found by no later grasp.
        """
        objects, positions_m = self.demonstration.ordered_objects, self.motion.trajectory.positions_m
        grasps = [phase.last for phase in self.motion.phases if phase.gripper_open and not phase.ends_open]
        found: list[int | None] = []
        for frame in grasps if objects else ():
            off_m = [float(np.linalg.norm(pose.position_m - positions_m[frame])) for pose in objects]
            nearest, *others = sorted(range(len(objects)), key=off_m.__getitem__)
            clear = off_m[nearest] <= GRASPED_M and all(off_m[k] >= CLEARLY * off_m[nearest] for k in others)
            found.append(nearest if clear and nearest not in found else None)
        return tuple(found)

    def with_keyframes(self, keyframes: Sequence[Keyframe]) -> Demonstration:
        """The demonstration with the actions of these keyframes."""
        actions = tuple(self.motion.trajectory.action_at(k.frame, gripper_open=k.gripper_open) for k in keyframes)
        return replace(self.demonstration, actions=actions, later_objects=())


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
    for plan, places in enumerate(plans):
        members = [group[place] for place in places]
        for place, demonstration in zip(places, _of_one_signature(members), strict=True):
            found[place] = replace(demonstration, plan=plan)
    return tuple(found[place] for place in range(len(group)))


def _by_grasped(group: Sequence[Recording], places: Sequence[int]) -> list[list[int]]:
    """Recordings that grasp the same objects in the same order together; what is not clear fits any."""
    orders: list[tuple[tuple[int | None, ...], list[int]]] = []
    for place in places:
        grasped = group[place].grasped
        alike = next((members for order, members in orders if _same_order(order, grasped)), None)
        if alike is None:
            orders.append((grasped, [place]))
        else:
            alike.append(place)
    return [members for _, members in orders]


def _same_order(one: Sequence[int | None], other: Sequence[int | None]) -> bool:
    return all(None in pair or pair[0] == pair[1] for pair in zip(one, other, strict=True))


def _of_one_signature(members: Sequence[Recording]) -> list[Demonstration]:
    """With the keyframes of the recordings' rule; where these lose their paths, with as many as the paths need."""
    resting = 2 * sum(member.manner == "rests" for member in members) > len(members)
    numbers = _numbers([member.counts for member in members], most_frequent=resting)
    found = _with_numbers(members, numbers, as_found=resting)
    on_path = _numbers([member.counts_on_path for member in members], most_frequent=False)
    left_m = [member.left_m(item.actions) for member, item in zip(members, found, strict=True)]
    if on_path == numbers or not leave_path(left_m):
        return found
    return _with_numbers(members, on_path, as_found=False)


def _with_numbers(members: Sequence[Recording], numbers: tuple[int, ...], *, as_found: bool) -> list[Demonstration]:
    """With so many keyframes in each phase.

    Args:
        as_found: whether recordings that rest at so many keep their own.
    """
    own = [
        as_found and member.manner == "rests" and member.counts == numbers and len(member.keyframes) == sum(numbers)
        for member in members
    ]
    chosen = [
        list(member.keyframes) if keeps else _chosen(member, numbers, None)
        for member, keeps in zip(members, own, strict=True)
    ]
    for _ in range(ROUNDS if len(members) > 1 and not all(own) else 0):
        demonstrations = [member.with_keyframes(item) for member, item in zip(members, chosen, strict=True)]
        rows = plan_rows(demonstrations)
        chosen = [
            item if keeps else _chosen(member, numbers, (rows, place))
            for place, (member, keeps, item) in enumerate(zip(members, own, chosen, strict=True))
        ]
    return [member.with_keyframes(item) for member, item in zip(members, chosen, strict=True)]


def _numbers(counts: Sequence[tuple[int, ...]], *, most_frequent: bool) -> tuple[int, ...]:
    """How many keyframes each phase gets, as many as a reply may have in all."""
    if most_frequent:
        return Counter(counts).most_common(1)[0][0]
    numbers = [math.ceil(np.quantile(column, PATH_KEPT_SHARE)) for column in zip(*counts, strict=True)]
    while sum(numbers) > max(MAX_KEYFRAMES, len(numbers)):
        numbers[int(np.argmax(numbers))] -= 1
    return tuple(numbers)


def _chosen(
    recording: Recording, numbers: Sequence[int], others: tuple[Sequence[PlanRow], int] | None
) -> list[Keyframe]:
    """Keyframes as many as wanted in each phase.

    Args:
        others: the rows of all demonstrations and the recording's place among them, to lie near to; None: its own path
            alone decides.
    """
    found: list[Keyframe] = []
    for phase, path, number in zip(recording.motion.phases, recording.paths, numbers, strict=True):
        if number == 1:  # its end: no other pose is weighed
            found += at_frames(phase, [phase.last])
            continue
        costs = None
        if others is not None:
            rows, place = others
            costs = np.array(
                [_distances(recording, path, row, place) for row in rows[len(found) : len(found) + number]]
            )
            costs = TOGETHER_WEIGHT * np.minimum(costs, MAX_DISTANCE) ** 2
        frames = [int(path.frames[k]) for k in best_waypoints(path.deviations, number, costs)]
        if others is None:
            frames = at_tips(recording.motion.trajectory.positions_m, phase.first, frames, recording.rule.tolerance_m)
        found += at_frames(phase, frames)
    return found


def _distances(recording: Recording, path: HandPath, row: PlanRow, place: int) -> Array:
    """(N,) how far each pose of the path is from where the other demonstrations have the row, in tolerances."""
    demonstration = recording.demonstration
    origin = anchor_pose(row.anchors[place], demonstration, tilted_objects([demonstration]))
    trajectory = recording.motion.trajectory
    hands = Rotation.from_quat(trajectory.quaternions_xyzw[path.frames])
    offsets_m, rotations = origin.seen(trajectory.positions_m[path.frames], hands)
    off_m = np.linalg.norm(offsets_m - row.centre_m, axis=1)
    off_m += M_PER_RAD * (row.mean_rotation.inv() * rotations).magnitude()
    distances: Array = off_m / recording.rule.tolerance_m
    return distances
