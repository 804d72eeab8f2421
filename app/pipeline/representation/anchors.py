"""What each action of the demonstrations is best described relative to: an object, the world, or the arm's start."""

import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration, Query
from app.pipeline.geometry import tilt_rad, yaw_rad
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import ObjectPose

Frame = Literal["w", "o", "world", "start"]
OBJECT_FRAMES: tuple[Frame, ...] = ("w", "o")
TILT_RAD = math.radians(5)  # an object that leans more than this in any demonstration turns its frame fully
M_PER_RAD = 0.06  # 10 degrees of rotation weigh as much as 1 cm of position
APPROACH_M = 0.06  # beside where it grasps a hand hovers or lifts
CONTRADICTED_M = 0.03  # a frame in which a row spreads by this much more than in the other is not that of the row
EQUAL_SPREAD_M = 0.002  # pairs this close to the best count as equal: then the previous row's pair goes on
CLEARLY_LESS = 0.6  # the share of an object's spread below which the world or the start describe a row better
WORLD_REACH_M = 4.9  # farther from the world's origin a row has no digits for it
MANY_DEMONSTRATIONS = 5  # demonstrations from which on a single odd one does not decide
DECIDING_SHARE = 0.8  # the share of many demonstrations that decides
# Of a single demonstration: a hand that is square to an object's axes has to do with it rather than with a nearer one
SQUARE = Rotation.create_group("O")  # the 24 rotations that take axes to axes
MAX_OBLIQUE_RAD = math.radians(20)  # beyond this it is not square to it at all
OBLIQUE_M_PER_RAD = 0.3 / MAX_OBLIQUE_RAD  # 30 cm of distance for a hand that is not square


class Anchor(NamedTuple):
    """What an action is relative to.

    Attributes:
        object_name: empty for the frames `world` and `start`.
        frame: at the object's position `w`, world axes, or `o`, the object's own axes; `world`: the world frame itself;
            `start`: where the end effector was at first, world axes.
    """

    object_name: str
    frame: Frame


Anchors = tuple[Anchor, ...]
"""Of one row, each demonstration's."""
WORLD = Anchor("", "world")
START = Anchor("", "start")
NOT_TURNED = Rotation.identity()  # to make one takes as long as to turn ten vectors


def tilted_objects(scenes: Sequence[Query]) -> frozenset[str]:
    """Names of the objects whose z axis is not vertical in some scene."""
    return frozenset(
        pose.name
        for scene in scenes
        for pose in scene.objects
        if pose.quaternion_xyzw is not None and tilt_rad(Rotation.from_quat(pose.quaternion_xyzw)) > TILT_RAD
    )


def object_rotation(pose: ObjectPose, frame: str, tilted: frozenset[str]) -> Rotation:
    """The axes of a pose's frame in the world: none turned (`w`), yaw only, or the full rotation of a tilted object."""
    if frame == "w" or pose.quaternion_xyzw is None:
        return NOT_TURNED
    rotation = Rotation.from_quat(pose.quaternion_xyzw)
    return rotation if pose.name in tilted else Rotation.from_euler("z", yaw_rad(rotation))


def anchor_frame(anchor: Anchor, scene: Query, tilted: frozenset[str]) -> tuple[Array, Rotation]:
    """An anchor's origin (3,) in metres in the world frame, and its axes there.

    Args:
        scene: knows where the end effector was at first, if that is the anchor.
    """
    if anchor.frame == "world":
        return np.zeros(3), NOT_TURNED
    if anchor.frame == "start":
        assert scene.start is not None
        return scene.start.position_m, NOT_TURNED
    pose = scene.object(anchor.object_name)
    return pose.position_m, object_rotation(pose, anchor.frame, tilted)


def relative_action(
    demonstration: Demonstration, k: int, anchor: Anchor, tilted: frozenset[str]
) -> tuple[Array, Rotation]:
    """Action `k` relative to the anchor: offset (3,) in metres along the anchor's axes, and rotation."""
    origin_m, axes = anchor_frame(anchor, demonstration, tilted)
    action, to_anchor = demonstration.actions[k], axes.inv()
    offset_m: Array = to_anchor.apply(action.position_m - origin_m)
    return offset_m, to_anchor * Rotation.from_quat(action.quaternion_xyzw)


def choose_anchors(
    group: Sequence[Demonstration], tilted: frozenset[str], *, beyond_objects: bool = False
) -> list[list[Anchor]]:
    """For each action of a group of like demonstrations, every demonstration's anchor.

    The one chosen is that whose relative action spreads least over the group. A single demonstration does not spread:
    there the nearest object is chosen to whose axes the hand is square, and its own axes rather than the world's.

    Args:
        beyond_objects: whether the world and the start count as well, where they spread clearly less than any object.

    Returns:
        [action][demonstration]; demonstrations that name other objects have other anchors, at the same place in the
        order of mention.
    """
    candidates = _candidates(group)
    others = _beyond_objects(group) if beyond_objects else []
    spreads_m = [_spreads_m(group, anchors, tilted) for anchors in (*candidates, *others)]
    chosen: list[list[Anchor]] = []
    for k in range(len(group[0].actions)):
        of_objects = [spreads[k] for spreads in spreads_m[: len(candidates)]]
        best = min(of_objects)
        equal = [c for c, spread in zip(candidates, of_objects, strict=True) if spread <= best + EQUAL_SPREAD_M]
        choice = chosen[-1] if chosen and chosen[-1] in equal else equal[0]
        for anchors, spreads in zip(others, spreads_m[len(candidates) :], strict=True):
            if spreads[k] + EQUAL_SPREAD_M < CLEARLY_LESS * best:
                best, choice = spreads[k], anchors
        chosen.append(choice)
    known = dict(zip(map(tuple, (*candidates, *others)), spreads_m, strict=True))
    settled = _without_bystanders(group, list(map(tuple, chosen)), known)
    return [list(anchors) for anchors in _one_frame_in_approaches(group, settled, known)]


def _one_frame_in_approaches(
    group: Sequence[Demonstration], chosen: Sequence[Anchors], spreads_m: Mapping[Anchors, list[float]]
) -> list[Anchors]:
    """The same anchors, those of hover, grasp and lift in one frame of what is grasped.

    Where demonstrations show an object at one yaw both of its frames hold, and each row has whichever scatters less by
    chance: at another yaw the hand would turn between hover and grasp.

    Args:
        spreads_m: by anchors those of each row.
    """
    found = list(chosen)
    for grasp, _ in _held(group[0]):
        names = [anchor.object_name for anchor in found[grasp]]
        near = [
            [anchor.object_name for anchor in anchors] == names and _aside_m(group, k, grasp) <= APPROACH_M
            for k, anchors in enumerate(found)
        ]
        rows = _around(grasp, near)
        frames = [tuple(Anchor(name, frame) for name in names) for frame in OBJECT_FRAMES]
        if "" in names or len({found[k] for k in rows}) == 1 or any(frame not in spreads_m for frame in frames):
            continue
        best = min(frames, key=lambda frame: sum(spreads_m[frame][k] for k in rows))
        if all(spreads_m[best][k] - spreads_m[found[k]][k] <= CONTRADICTED_M for k in rows):
            found[rows.start : rows.stop] = [best] * len(rows)
    return found


def _without_bystanders(
    group: Sequence[Demonstration], chosen: Sequence[Anchors], spreads_m: Mapping[Anchors, list[float]]
) -> list[Anchors]:
    """The same anchors, rows in which something is held on this, on where it comes to, or on no object.

    Another object is near by chance, unless several demonstrations keep clearly closer to it: they go around it.
    """
    found = list(chosen)
    for grasp, release in _held(group[0]):
        ends = {tuple(anchor.object_name for anchor in found[k]) for k in (grasp, release)}
        usable = [
            anchors for anchors in spreads_m if not any(a.object_name for a in anchors) or _names(anchors) in ends
        ]
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
    """Of each grasp its row and that of the release after it, or the last."""
    states = [action.gripper_open for action in demonstration.actions]
    grasps = [k for k in range(1, len(states)) if states[k - 1] and not states[k]]
    return [(k, next((r for r in range(k, len(states)) if states[r]), len(states) - 1)) for k in grasps]


def _aside_m(group: Sequence[Demonstration], k: int, grasp: int) -> float:
    """How far the hand is at most beside where it grasps."""
    ways_m = [(d.actions[k].position_m - d.actions[grasp].position_m)[:2] for d in group]
    return float(np.linalg.norm(ways_m, axis=1).max())


def _around(place: int, belongs: Sequence[bool]) -> range:
    """The stretch of rows around one that belong to it."""
    first = last = place
    while first > 0 and belongs[first - 1]:
        first -= 1
    while last + 1 < len(belongs) and belongs[last + 1]:
        last += 1
    return range(first, last + 1)


def _candidates(group: Sequence[Demonstration]) -> list[list[Anchor]]:
    """Per candidate one anchor for each demonstration: objects by order of mention, the others by name.

    The likelier first; a single demonstration rather follows an object's own axes.
    """
    ordered = [d.ordered_objects for d in group]
    mentioned = [len(d.order.objects) for d in group]
    by_mention = [[objects[i].name for objects in ordered] for i in range(min(mentioned))]
    never_mentioned = [
        pose.name
        for pose in group[0].objects
        if all(pose.name not in [p.name for p in o[:m]] for o, m in zip(ordered, mentioned, strict=True))
    ]
    columns = by_mention + [[name] * len(group) for name in never_mentioned]
    frames = OBJECT_FRAMES[::-1] if len(group) == 1 else OBJECT_FRAMES
    without_rotation = {pose.name for d in group for pose in d.objects if pose.quaternion_xyzw is None}
    return [
        [Anchor(name, frame) for name in column]
        for column in columns
        for frame in frames
        if frame == "w" or without_rotation.isdisjoint(column)
    ]


def _beyond_objects(group: Sequence[Demonstration]) -> list[list[Anchor]]:
    """The world, and the start where every demonstration knows it; one demonstration cannot tell them from objects."""
    if len(group) == 1:
        return []
    started = all(demonstration.start is not None for demonstration in group)
    near = all(np.abs(action.position_m).max() < WORLD_REACH_M for d in group for action in d.actions)
    usable = ((WORLD, near), (START, started))
    return [[anchor] * len(group) for anchor, can in usable if can]


def _spreads_m(group: Sequence[Demonstration], anchors: Sequence[Anchor], tilted: frozenset[str]) -> list[float]:
    """How far each action differs over the group relative to the anchors; rotations weigh in as metres."""
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
    """(K,) how far each hand is from square to the axes that it is relative to, as metres."""
    off_rad = np.min([(turn.inv() * hands).magnitude() for turn in SQUARE], axis=0)
    oblique: Array = OBLIQUE_M_PER_RAD * np.minimum(off_rad, MAX_OBLIQUE_RAD)
    return oblique


def relative_poses(demonstration: Demonstration, anchor: Anchor, tilted: frozenset[str]) -> tuple[Array, Rotation]:
    """Every action relative to the anchor: offsets (K, 3) in metres along its axes, and K rotations."""
    origin_m, axes = anchor_frame(anchor, demonstration, tilted)
    actions, to_anchor = demonstration.actions, axes.inv()
    if not actions:
        return np.zeros((0, 3)), to_anchor
    offsets_m: Array = to_anchor.apply(np.array([action.position_m for action in actions]) - origin_m)
    return offsets_m, to_anchor * Rotation.from_quat([action.quaternion_xyzw for action in actions])
