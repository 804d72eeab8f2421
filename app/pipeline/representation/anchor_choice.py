"""Chooses the anchor of each action: the frame relative to which demonstrations of one plan scatter least."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.representation.anchor_scatter import (
    MIN_SCATTERED,
    around,
    certain_share,
    farthest_m,
    hands_at,
    much_less,
    scatters_m,
)
from app.pipeline.representation.anchors import (
    MIXED_FRAMES,
    OBJECT_FRAMES,
    START,
    WORLD,
    Anchor,
    Anchors,
    anchor_poses,
    in_frame,
    names_of,
)
from app.pipeline.representation.axis_choice import WORLD_REACH_M, along_axes
from app.pipeline.representation.direction_choice import toward_others

ONE_YAW_RAD = math.radians(5)  # objects that are turned by less do not tell their two frames apart
NO_YAW_RAD = 1e-6  # rounding: no pose that was measured is as equal
MUCH_MORE_M = 0.03  # a row that scatters by this much more in one frame than in the other does not have it
EQUAL_SPREAD_M = 0.002  # anchors this close to the best count as equal: then the previous row's anchor is kept
CLEARLY_LESS = 0.6  # share of the best object's scatter below which the world or the start is chosen instead

Spreads = dict[Anchors, list[float]]
"""The scatter of each row relative to these anchors, in meters."""


def choose_anchors(
    group: Sequence[Demonstration], tilted: frozenset[str], *, beyond_objects: bool = False
) -> list[Anchors]:
    """Return for each action of demonstrations of one plan the anchor in every demonstration.

    The chosen anchor is the one relative to which the action scatters least over the group; the frames `ow` and `wo` of
    an object count only where `_mixed_frames` is certain. A single demonstration has no scatter: its anchor is the
    nearest object with whose axes the hand is aligned, in the object's own axes.

    Args:
        beyond_objects: whether the world and the start may be anchors where they scatter clearly less than any object,
            and single axes may follow something else than the others.

    Returns:
        [action][demonstration]; in demonstrations that name other objects the anchor is the object that is mentioned in
        the same place.
    """
    columns = [tuple(Anchor(name, "wo", tilted=tilted) for name in names) for names in _columns(group)]
    at_objects, beyond = _at_objects(group, columns), _beyond_objects(group) if beyond_objects else []
    spreads_m = {anchors: farthest_m(group, anchors) for anchors in (*at_objects, *beyond)}
    chosen: list[Anchors] = []
    for k in range(len(group[0].actions)):
        best = min(spreads_m[anchors][k] for anchors in at_objects)
        equal = [anchors for anchors in at_objects if spreads_m[anchors][k] <= best + EQUAL_SPREAD_M]
        choice = chosen[-1] if chosen and chosen[-1] in equal else equal[0]
        for anchors in beyond:
            if spreads_m[anchors][k] + EQUAL_SPREAD_M < CLEARLY_LESS * best:
                best, choice = spreads_m[anchors][k], anchors
        chosen.append(choice)
    _replace_bystanders(group, chosen, spreads_m)
    for own in [anchors for anchors in at_objects if anchors[0].frame == "o"]:
        for anchors, rows in _mixed_frames(group, own).items():
            spreads_m[anchors] = farthest_m(group, anchors)
            for k in rows:
                chosen[k] = min(chosen[k], anchors, key=lambda one: spreads_m[one][k])
    _unite_approaches(group, chosen, spreads_m)
    return toward_others(group, along_axes(group, chosen, columns), columns) if beyond_objects else chosen


def _columns(group: Sequence[Demonstration]) -> list[tuple[str, ...]]:
    """Return the objects, each by its name in every demonstration: by order of mention, then those never mentioned."""
    mentioned = [demonstration.order.objects for demonstration in group]
    never_mentioned = [pose.name for pose in group[0].objects if all(pose.name not in names for names in mentioned)]
    return [*zip(*mentioned, strict=False), *((name,) * len(group) for name in never_mentioned)]


def _at_objects(group: Sequence[Demonstration], columns: Sequence[Anchors]) -> list[Anchors]:
    """Return candidate anchors at objects.

    The more likely frame comes first: the world's axes, or for a single demonstration the object's own.
    """
    frames = OBJECT_FRAMES[::-1] if len(group) == 1 else OBJECT_FRAMES
    without_rotation = {pose.name for d in group for pose in d.objects if pose.quaternion_xyzw is None}
    return [
        in_frame(column, frame)
        for column in columns
        for frame in frames
        if frame == "w" or without_rotation.isdisjoint(names_of(column))
    ]


def _beyond_objects(group: Sequence[Demonstration]) -> list[Anchors]:
    """Return the world, and the start if every demonstration has one; none for a single demonstration."""
    if len(group) == 1:
        return []
    started = all(demonstration.start is not None for demonstration in group)
    near = all(np.abs(action.position_m).max() < WORLD_REACH_M for d in group for action in d.actions)
    usable = ((WORLD, near), (START, started))
    return [(anchor,) * len(group) for anchor, can in usable if can]


def _mixed_frames(group: Sequence[Demonstration], own: Anchors) -> dict[Anchors, list[int]]:
    """Return the rows in which only the position or only the rotation of the hand turns with an object, by frame.

    At least three demonstrations must contradict both frames `w` and `o`, one by the position and the other by the
    rotation: each scatters along the wrong axes, and along the right ones by a share of it that is small beyond chance.

    Args:
        own: the objects' own frames.
    """
    if len(group) < MIN_SCATTERED or not group[0].actions:
        return {}
    certain = certain_share(len(group), 2)
    world_m, own_m = scatters_m(group, own)
    by_world, by_own = much_less(world_m, own_m, certain), much_less(own_m, world_m, certain)
    rows = np.stack([by_own[0] & by_world[1], by_world[0] & by_own[1]])
    found = zip(MIXED_FRAMES, rows, strict=True)
    return {in_frame(own, frame): np.flatnonzero(which).tolist() for frame, which in found if which.any()}


def _replace_bystanders(group: Sequence[Demonstration], chosen: list[Anchors], spreads_m: Spreads) -> None:
    """Replace bystanders in rows between a grasp and its release.

    Such rows are anchored at the held object, at the object where it is released, or at no object. Another object is
    near by chance, unless demonstrations scatter clearly less relative to it, as when they go around it, or a single
    demonstration's instruction names it, as when something is poured into it.
    """
    named = {(name,) for name in group[0].order.objects} if len(group) == 1 else set()
    for grasp, release in _held(group[0]):
        ends = {names_of(chosen[k]) for k in (grasp, release)} | named
        usable = [anchors for anchors in spreads_m if not any(names_of(anchors)) or names_of(anchors) in ends]
        for k in range(grasp + 1, release):
            if names_of(chosen[k]) in ends or not any(names_of(chosen[k])) or not usable:
                continue
            best = min(usable, key=lambda anchors: spreads_m[anchors][k])
            if len(group) == 1 or spreads_m[chosen[k]][k] >= CLEARLY_LESS * spreads_m[best][k]:
                chosen[k] = best


def _unite_approaches(group: Sequence[Demonstration], chosen: list[Anchors], spreads_m: Spreads) -> None:
    """Give hover, grasp and lift of each object one frame.

    If all demonstrations show an object at one yaw, both of its frames fit, and noise decides which scatters less in a
    row: at another yaw the hand would then turn between hover and grasp. It follows the object's axes, as with a single
    demonstration.
    """
    for grasp, _ in _held(group[0]):
        names = names_of(chosen[grasp])
        near = around(hands_at(group), grasp)
        rows = _stretch(grasp, [is_near and names_of(chosen[k]) == names for k, is_near in enumerate(near)])
        _, own = frames = [in_frame(chosen[grasp], frame) for frame in OBJECT_FRAMES]
        if "" in names or any(frame not in spreads_m for frame in frames):
            continue
        frames += dict.fromkeys(chosen[k] for k in rows if chosen[k] not in frames)
        best = min(frames, key=lambda frame: sum(spreads_m[frame][k] for k in rows))
        if _at_one_yaw(group, own):
            best = own
        elif len({chosen[k] for k in rows}) == 1:
            continue
        if all(spreads_m[best][k] - spreads_m[chosen[k]][k] <= MUCH_MORE_M for k in rows):
            chosen[rows.start : rows.stop] = [best] * len(rows)


def _held(demonstration: Demonstration) -> list[tuple[int, int]]:
    """Return (row of the grasp, row of its release or the last row) for each grasp."""
    states = [action.gripper_open for action in demonstration.actions]
    grasps = [k for k in demonstration.switches if not states[k]]
    return [(k, next((r for r in range(k, len(states)) if states[r]), len(states) - 1)) for k in grasps]


def _stretch(place: int, belongs: Sequence[bool]) -> range:
    """Return the longest range of rows around `place` in which `belongs` is true."""
    first = last = place
    while first > 0 and belongs[first - 1]:
        first -= 1
    while last + 1 < len(belongs) and belongs[last + 1]:
        last += 1
    return range(first, last + 1)


def _at_one_yaw(group: Sequence[Demonstration], own: Anchors) -> bool:
    """Return whether the objects of these frames are turned alike in all demonstrations, but not exactly.

    One that is turned exactly alike has no yaw to follow: it is round, or nothing observes how it is turned.
    """
    axes = Rotation.from_quat(anchor_poses(own, group).place_axes_xyzw)
    return NO_YAW_RAD < float((axes[0].inv() * axes).magnitude().max()) <= ONE_YAW_RAD
