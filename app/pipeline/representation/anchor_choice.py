"""Chooses the anchor of each action: the frame relative to which demonstrations of one plan scatter least."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.representation.anchors import (
    OBJECT_FRAMES,
    START,
    WORLD,
    Anchor,
    Anchors,
    anchor_pose,
    in_frame,
    mixed_frames,
    relative_poses,
)
from app.pipeline.representation.axis_choice import WORLD_REACH_M, by_axis
from app.pipeline.representation.between import between
from app.pipeline.thresholds import M_PER_RAD
from roboprompt_client.types.arrays import Array

APPROACH_M = 0.06  # horizontal distance from a grasp within which the hand hovers or lifts
ONE_YAW_RAD = math.radians(5)  # objects that are turned by less do not tell their two frames apart
NO_YAW_RAD = 1e-6  # rounding: no pose that was measured is as equal
CONTRADICTED_M = 0.03  # a row that scatters by this much more in one frame than in the other does not have it
EQUAL_SPREAD_M = 0.002  # anchors this close to the best count as equal: then the previous row's anchor is kept
CLEARLY_LESS = 0.6  # share of the best object's scatter below which the world or the start is chosen instead
MANY_DEMONSTRATIONS = 5  # from this number on a quantile replaces the maximum, so that one outlier does not decide
DECIDING_SHARE = 0.8  # that quantile
# Of a single demonstration: a hand that is aligned with an object's axes acts at it rather than at a nearer object
SQUARE = Rotation.create_group("O")  # the 24 rotations that take axes to axes
MAX_OBLIQUE_RAD = math.radians(20)  # beyond this angle it is not aligned
OBLIQUE_M_PER_RAD = 0.3 / MAX_OBLIQUE_RAD  # a hand that is not aligned counts as 30 cm farther


def choose_anchors(
    group: Sequence[Demonstration], tilted: frozenset[str], *, beyond_objects: bool = False
) -> list[Anchors]:
    """Return for each action of demonstrations of one plan the anchor in every demonstration.

    The chosen anchor is the one relative to which the action scatters least over the group; the frames `ow` and `wo` of
    an object count only where `mixed_frames` is certain. A single demonstration has no scatter: its anchor is the
    nearest object with whose axes the hand is aligned, in the object's own axes.

    Args:
        beyond_objects: whether the world and the start may be anchors where they scatter clearly less than any object.

    Returns:
        [action][demonstration]; in demonstrations that name other objects the anchor is the object that is mentioned in
        the same place.
    """
    at_objects, beyond = _at_objects(group), _beyond_objects(group) if beyond_objects else []
    spreads_m = {anchors: _spreads_m(group, anchors, tilted) for anchors in (*at_objects, *beyond)}
    chosen: list[Anchors] = []
    for k in range(len(group[0].actions)):
        best = min(spreads_m[anchors][k] for anchors in at_objects)
        equal = [anchors for anchors in at_objects if spreads_m[anchors][k] <= best + EQUAL_SPREAD_M]
        choice = chosen[-1] if chosen and chosen[-1] in equal else equal[0]
        for anchors in beyond:
            if spreads_m[anchors][k] + EQUAL_SPREAD_M < CLEARLY_LESS * best:
                best, choice = spreads_m[anchors][k], anchors
        chosen.append(choice)
    settled = _without_bystanders(group, chosen, spreads_m)
    for own in [anchors for anchors in at_objects if anchors[0].frame == "o"]:
        for anchors, rows in mixed_frames(group, own, tilted).items():
            spreads_m[anchors] = _spreads_m(group, anchors, tilted)
            for k in rows:
                settled[k] = min(settled[k], anchors, key=lambda one: spreads_m[one][k])
    found = _one_frame_in_approaches(group, settled, spreads_m, tilted)
    if not beyond_objects:
        return found
    columns = _columns(group)
    return between(group, by_axis(group, found, columns, tilted), columns, tilted)


def _one_frame_in_approaches(
    group: Sequence[Demonstration],
    chosen: Sequence[Anchors],
    spreads_m: Mapping[Anchors, list[float]],
    tilted: frozenset[str],
) -> list[Anchors]:
    """Return the anchors with hover, grasp and lift of each object in one frame.

    If all demonstrations show an object at one yaw, both of its frames fit, and noise decides which scatters less in a
    row: at another yaw the hand would then turn between hover and grasp. It follows the object's axes, as with a single
    demonstration.

    Args:
        spreads_m: by anchors the scatter of each row.
    """
    found = list(chosen)
    for grasp, _ in _held(group[0]):
        names = _names(found[grasp])
        near = [_names(anchors) == names and _aside_m(group, k, grasp) <= APPROACH_M for k, anchors in enumerate(found)]
        rows = _around(grasp, near)
        _, own = frames = [in_frame(found[grasp], frame) for frame in OBJECT_FRAMES]
        if "" in names or any(frame not in spreads_m for frame in frames):
            continue
        frames += dict.fromkeys(found[k] for k in rows if found[k] not in frames)
        best = min(frames, key=lambda frame: sum(spreads_m[frame][k] for k in rows))
        if _at_one_yaw(group, own, tilted):
            best = own
        elif len({found[k] for k in rows}) == 1:
            continue
        if all(spreads_m[best][k] - spreads_m[found[k]][k] <= CONTRADICTED_M for k in rows):
            found[rows.start : rows.stop] = [best] * len(rows)
    return found


def _at_one_yaw(group: Sequence[Demonstration], own: Anchors, tilted: frozenset[str]) -> bool:
    """Return whether the objects of these frames are turned alike in all demonstrations, but not exactly.

    One that is turned exactly alike has no yaw to follow: it is round, or nothing observes how it is turned.
    """
    axes = [anchor_pose(anchor, shown, tilted).place_axes for anchor, shown in zip(own, group, strict=True)]
    return NO_YAW_RAD < max(float((axes[0].inv() * other).magnitude()) for other in axes) <= ONE_YAW_RAD


def _without_bystanders(
    group: Sequence[Demonstration], chosen: Sequence[Anchors], spreads_m: Mapping[Anchors, list[float]]
) -> list[Anchors]:
    """Return the anchors with bystanders replaced in rows between a grasp and its release.

    Such rows are anchored at the held object, at the object where it is released, or at no object. Another object is
    near by chance, unless demonstrations scatter clearly less relative to it, as when they go around it, or a single
    demonstration's instruction names it, as when something is poured into it.
    """
    found = list(chosen)
    named = {(name,) for name in group[0].order.objects} if len(group) == 1 else set()
    for grasp, release in _held(group[0]):
        ends = {_names(found[k]) for k in (grasp, release)} | named
        usable = [anchors for anchors in spreads_m if not any(_names(anchors)) or _names(anchors) in ends]
        for k in range(grasp + 1, release):
            if _names(found[k]) in ends or not any(_names(found[k])) or not usable:
                continue
            best = min(usable, key=lambda anchors: spreads_m[anchors][k])
            if len(group) == 1 or spreads_m[found[k]][k] >= CLEARLY_LESS * spreads_m[best][k]:
                found[k] = best
    return found


def _names(anchors: Anchors) -> tuple[str, ...]:
    return tuple(anchor.object_name for anchor in anchors)


def _held(demonstration: Demonstration) -> list[tuple[int, int]]:
    """Return (row of the grasp, row of its release or the last row) for each grasp."""
    states = [action.gripper_open for action in demonstration.actions]
    grasps = [k for k in range(1, len(states)) if states[k - 1] and not states[k]]
    return [(k, next((r for r in range(k, len(states)) if states[r]), len(states) - 1)) for k in grasps]


def _aside_m(group: Sequence[Demonstration], k: int, grasp: int) -> float:
    """Return the largest horizontal distance of row `k` from the grasp over the group."""
    ways_m = [(d.actions[k].position_m - d.actions[grasp].position_m)[:2] for d in group]
    return float(np.linalg.norm(ways_m, axis=1).max())


def _around(place: int, belongs: Sequence[bool]) -> range:
    """Return the longest range of rows around `place` in which `belongs` is true."""
    first = last = place
    while first > 0 and belongs[first - 1]:
        first -= 1
    while last + 1 < len(belongs) and belongs[last + 1]:
        last += 1
    return range(first, last + 1)


def _at_objects(group: Sequence[Demonstration]) -> list[Anchors]:
    """Return candidate anchors at objects: mentioned objects by their order of mention, others by name.

    The more likely frame comes first: the world's axes, or for a single demonstration the object's own.
    """
    frames = OBJECT_FRAMES[::-1] if len(group) == 1 else OBJECT_FRAMES
    without_rotation = {pose.name for d in group for pose in d.objects if pose.quaternion_xyzw is None}
    return [
        tuple(Anchor(name, frame) for name in column)
        for column in _columns(group)
        for frame in frames
        if frame == "w" or without_rotation.isdisjoint(column)
    ]


def _columns(group: Sequence[Demonstration]) -> list[Sequence[str]]:
    """Return the objects, each by its name in every demonstration."""
    ordered = [d.ordered_objects for d in group]
    mentioned = [len(d.order.objects) for d in group]
    by_mention = [[objects[i].name for objects in ordered] for i in range(min(mentioned))]
    never_mentioned = [
        pose.name
        for pose in group[0].objects
        if all(pose.name not in [p.name for p in o[:m]] for o, m in zip(ordered, mentioned, strict=True))
    ]
    return [*by_mention, *([name] * len(group) for name in never_mentioned)]


def _beyond_objects(group: Sequence[Demonstration]) -> list[Anchors]:
    """Return the world, and the start if every demonstration has one; none for a single demonstration."""
    if len(group) == 1:
        return []
    started = all(demonstration.start is not None for demonstration in group)
    near = all(np.abs(action.position_m).max() < WORLD_REACH_M for d in group for action in d.actions)
    usable = ((WORLD, near), (START, started))
    return [(anchor,) * len(group) for anchor, can in usable if can]


def _spreads_m(group: Sequence[Demonstration], anchors: Anchors, tilted: frozenset[str]) -> list[float]:
    """Return the scatter of each action relative to the anchors, in meters; rotations count by `M_PER_RAD`."""
    relative = [relative_poses(d, anchor, tilted) for d, anchor in zip(group, anchors, strict=True)]
    offsets_m = np.array([offsets for offsets, _ in relative])  # (N, K, 3)
    if len(group) == 1:
        alone: list[float] = (np.linalg.norm(offsets_m[0], axis=1) + _oblique_m(relative[0][1])).tolist()
        return alone
    off_m = np.abs(offsets_m - np.median(offsets_m, axis=0)).max(axis=2)
    for k in range(off_m.shape[1]):
        rotations = Rotation.concatenate([turned[k] for _, turned in relative])
        off_m[:, k] += M_PER_RAD * (rotations.mean().inv() * rotations).magnitude()
    spreads: list[float] = (
        np.quantile(off_m, DECIDING_SHARE, axis=0) if len(group) >= MANY_DEMONSTRATIONS else off_m.max(axis=0)
    ).tolist()
    return spreads


def _oblique_m(hands: Rotation) -> Array:
    """Return the misalignment (K,) of hands with the axes that they are relative to, in meters."""
    off_rad = np.min([(turn.inv() * hands).magnitude() for turn in SQUARE], axis=0)
    oblique: Array = OBLIQUE_M_PER_RAD * np.minimum(off_rad, MAX_OBLIQUE_RAD)
    return oblique
