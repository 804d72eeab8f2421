"""A demonstration with the motion that it was made from: its phases, the keyframes they need, and the best ones."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.keyframes import Keyframe, KeyframeRule, Manner, Motion, find_keyframes, manner_of, waypoints
from app.pipeline.keyframes.motion import Phase
from app.pipeline.keyframes.path import HandPath
from app.pipeline.keyframes.resting import path_left_m
from app.pipeline.keyframes.rules import at_frames, at_tips, best_waypoints
from app.pipeline.plans.rows import PlanRow
from app.pipeline.plans.turn import HALF_TURN, half_turned, turned_from_most
from app.pipeline.representation.anchors import anchor_pose
from app.pipeline.thresholds import GRASPED_M, M_PER_RAD
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

CLEARLY = 2.0  # an object is grasped if all others are so many times as far
TOGETHER_WEIGHT = 0.3  # of the squared distance between demonstrations, relative to the squared deviation of the path
MAX_DISTANCE = 3.0  # in tolerances; larger distances between demonstrations cost no more

Distances = Callable[[HandPath, int], Array]
"""From a path and a keyframe's number: (N,) distances of its poses from that keyframe of others, in tolerances."""


class Touch(NamedTuple):
    """The hand at an object.

    Attributes:
        taking: its rotation where it took what it lets go of here; None where it takes something itself.
    """

    hand: Rotation
    taking: Rotation | None


@dataclass(frozen=True, eq=False)
class Recording:
    """A demonstration with the motion that it was made from.

    Attributes:
        stays: whether a last phase is added in which the hand stays where the recording ends, as most others go on.
    """

    demonstration: Demonstration
    motion: Motion
    rule: KeyframeRule
    stays: bool = False

    @cached_property
    def manner(self) -> Manner:
        """Whether the recording rests at its keyframes, hesitates or flows."""
        if self.rule.rule == "waypoints":
            return "flows"
        return manner_of(self.motion, self.rule.delta_rad_s)

    @cached_property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """The keyframes by its rule; waypoints where the rule skips one of several switches in a rest."""
        found = (*find_keyframes(self.motion, self.rule), *self._last)
        if len(self._counts_of(found)) == len(self.phases):
            return found
        return self._waypoints

    @cached_property
    def phases(self) -> tuple[Phase, ...]:
        """The phases of the motion, with the one that is added."""
        return (*self.motion.phases, *(Phase(frame, frame, is_open, is_open) for frame, is_open in self._last))

    @property
    def _last(self) -> list[Keyframe]:
        return [Keyframe(len(self.motion) - 1, self.motion.phases[-1].ends_open)] if self.stays else []

    @cached_property
    def _waypoints(self) -> tuple[Keyframe, ...]:
        return (*waypoints(self.motion, self.rule.tolerance_m, self.rule.tolerance_deg), *self._last)

    @cached_property
    def paths(self) -> tuple[HandPath, ...]:
        """The hand's path in each phase."""
        tolerances = (self.rule.tolerance_m, self.rule.tolerance_deg)
        return tuple(self.motion.path(phase.first, phase.last, *tolerances) for phase in self.phases)

    @property
    def counts(self) -> tuple[int, ...]:
        """The number of its own keyframes in each phase; the last of a phase is where the gripper switches."""
        by_switches = self._counts_of(self.keyframes)
        if len(by_switches) == len(self.phases):
            return by_switches
        # Keyframes that show other switches than there are are counted by time.
        frames = [keyframe.frame for keyframe in self.keyframes]
        return tuple(max(1, sum(phase.first < frame <= phase.last for frame in frames)) for phase in self.phases)

    def _counts_of(self, keyframes: Sequence[Keyframe]) -> tuple[int, ...]:
        counts, state = [0], self.phases[0].gripper_open
        for keyframe in keyframes:
            counts[-1] += 1
            if keyframe.gripper_open != state:
                counts.append(0)
                state = keyframe.gripper_open
        return tuple(counts if counts[-1] else counts[:-1])

    @cached_property
    def counts_on_path(self) -> tuple[int, ...]:
        """The number of keyframes that its path needs in each phase, whether it rests or not."""
        return self._counts_of(self._waypoints)

    def left_m(self, actions: Sequence[EndEffectorAction]) -> float:
        """The largest distance by which motion through these actions leaves its path where that matters."""
        return path_left_m(self.motion, self.manner, actions)

    @property
    def signature(self) -> tuple[bool, ...]:
        """The states of the gripper (open or not), in order."""
        return (self.phases[0].gripper_open, *(phase.ends_open for phase in self.phases))

    @cached_property
    def grasped(self) -> tuple[int | None, ...]:
        """The object that the hand closes on at each grasp, by its index in the order of mention; None: not clear.

        Where objects stand is known before the first action: one that was moved is found by no later grasp.
        """
        objects, positions_m = self.demonstration.ordered_objects, self.motion.trajectory.positions_m
        found: list[int | None] = []
        for phase in self.phases:
            if phase.gripper_open and not phase.ends_open:
                place = clearly_nearest(objects, positions_m[phase.last])
                found.append(None if place in found else place)
        return tuple(found)

    def with_keyframes(self, keyframes: Sequence[Keyframe]) -> Demonstration:
        """The demonstration with the actions of these keyframes."""
        actions = tuple(self.motion.trajectory.action_at(k.frame, gripper_open=k.gripper_open) for k in keyframes)
        return replace(self.demonstration, actions=actions)

    @property
    def half_turned(self) -> "Recording":
        """The recording with the hand turned by 180 degrees about its approach axis throughout."""
        shown, trajectory = self.demonstration, self.motion.trajectory
        quaternions_xyzw = np.array([quaternions.product(q, HALF_TURN) for q in trajectory.quaternions_xyzw])
        start = None if shown.start is None else half_turned(shown.start)
        return replace(
            self,
            demonstration=replace(shown, actions=tuple(map(half_turned, shown.actions)), start=start),
            motion=replace(self.motion, trajectory=replace(trajectory, quaternions_xyzw=quaternions_xyzw)),
        )


def alike_turned(alike: Sequence[Recording]) -> list[Recording]:
    """Return recordings of one form of instruction; those whose grasp is half a turn from most others' half turned."""
    turned = turned_from_most([recording.demonstration for recording in alike])
    return [one.half_turned if turns else one for one, turns in zip(alike, turned, strict=True)]


def clearly_nearest(objects: Sequence[ObjectPose], position_m: Array) -> int | None:
    """Return the index of the object that a hand at a position (3,) grasps; None if it is not clear."""
    off_m = np.array([np.linalg.norm(pose.position_m - position_m) for pose in objects])
    order = np.argsort(off_m, kind="stable").tolist()
    if not order or off_m[order[0]] > GRASPED_M:
        return None
    clear = len(order) == 1 or off_m[order[1]] >= CLEARLY * off_m[order[0]]
    return order[0] if clear else None


def touched(recording: Recording) -> dict[str, Touch]:
    """Return how the hand clearly grasps an object, or lets go of another one at it, by its name."""
    found: dict[str, Touch] = {}
    trajectory, taking = recording.motion.trajectory, None
    for phase in (phase for phase in recording.phases if phase.gripper_open != phase.ends_open):
        hand = Rotation.from_quat(trajectory.quaternions_xyzw[phase.last])
        left = [pose for pose in recording.demonstration.objects if pose.name not in found]
        if (place := clearly_nearest(left, trajectory.positions_m[phase.last])) is not None:
            found[left[place].name] = Touch(hand, taking)
        taking = None if phase.ends_open else hand
    return found


def choose(recording: Recording, numbers: Sequence[int], distances: Distances | None) -> list[Keyframe]:
    """Return the best keyframes of one recording, with these numbers in the phases.

    Args:
        distances: from the other demonstrations, a second cost; None: only the deviation from the path counts.
    """
    found: list[Keyframe] = []
    for phase, path, number in zip(recording.phases, recording.paths, numbers, strict=True):
        if number == 1:  # the end of the phase
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


def off_rows(recording: Recording, rows: Sequence[PlanRow], place: int, path: HandPath, k: int) -> Array:
    """Return `Distances` from the centers of rows, in which the recording has index `place`."""
    row, trajectory = rows[k], recording.motion.trajectory
    hands = Rotation.from_quat(trajectory.quaternions_xyzw[path.frames])
    origin = anchor_pose(row.anchors[place], recording.demonstration)
    offsets_m, rotations = origin.seen(trajectory.positions_m[path.frames], hands)
    off_m = np.linalg.norm(offsets_m - row.center_m, axis=1)
    off_m += M_PER_RAD * (row.mean_rotation.inv() * rotations).magnitude()
    distances: Array = off_m / recording.rule.tolerance_m
    return distances


def off_one(recording: Recording, shown: Recording, keyframes: Sequence[Keyframe], path: HandPath, k: int) -> Array:
    """Return `Distances` from the keyframes of one demonstration, each the least over the world and all objects."""
    places_m = recording.motion.trajectory.positions_m[path.frames]
    shown_m = shown.motion.trajectory.positions_m[keyframes[k].frame]
    objects = zip(recording.demonstration.ordered_objects, shown.demonstration.ordered_objects, strict=True)
    moved_m = np.array([np.zeros(3), *(here.position_m - there.position_m for here, there in objects)])
    off_m = np.linalg.norm(places_m - (shown_m + moved_m)[:, None], axis=2).min(axis=0)
    distances: Array = off_m / recording.rule.tolerance_m
    return distances
