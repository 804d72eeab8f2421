"""Anchors: the object, the world, or the arm's start that an action is relative to; and their poses in a scene.

At an object the hand's position and its rotation are each relative to the object's axes or to the world's. Usually
both turn with the object, or neither. A hand that presses the rim of a mug above its handle keeps its rotation while
its position turns with the mug; one that turns with a valve but stays on the robot's side of it does the reverse.
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import betaincinv

from app.pipeline.episode import Demonstration, Query
from app.pipeline.geometry import tilt_rad, yaw_rad
from app.pipeline.order.order import Order
from app.pipeline.thresholds import M_PER_RAD, TURNED_M
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

Frame = Literal["w", "o", "ow", "wo", "world", "start"]
OBJECT_FRAMES: tuple[Frame, ...] = ("w", "o")
MIXED_FRAMES: tuple[Frame, ...] = ("ow", "wo")
TILT_RAD = math.radians(5)  # the frame of an object that leans by more has its full rotation, not only its yaw
MANY_TURNED = 8  # from this number of demonstrations on, the farthest are left out as outliers:
DECIDING_SHARE = 0.8  # this share is kept; of fewer, the one turned unlike the others may decide
MIN_TURNED = 3  # demonstrations that show what turns with an object
TURNED_SHARE = 0.6  # largest share of it that remains along the right axes; less for few, see `mixed_frames`
SERVES_M = 0.02  # largest scatter along the right axes: rows on the way that scatter more have none
CHANCE = 0.01  # significance level of the F test in `mixed_frames`


class Anchor(NamedTuple):
    """The frame that an action is relative to.

    Attributes:
        object_name: empty for the frames `world` and `start`.
        frame: at the object's position `w`, world axes, or `o`, the object's own axes; `ow`: its own for the hand's
            place and the world's for its rotation, `wo` the reverse; `world`: the world frame itself; `start`: where
            the end effector was at first, world axes.
        along: axes of the world (0 to 2) along which the hand's place follows something else than the object: the name
            of another object, or empty for the world; where the place turns with the object the height or all.
        tenths: of the way from the object to the other one, along these axes.
    """

    object_name: str
    frame: Frame
    along: tuple[tuple[int, str], ...] = ()
    tenths: int = 10

    @property
    def names(self) -> frozenset[str]:
        """All objects that it depends on."""
        return frozenset((self.object_name, *(name for _, name in self.along))) - {""}

    @property
    def place_turns(self) -> bool:
        """Whether the hand's position is along the object's own axes."""
        return self.frame in ("o", "ow")

    @property
    def hand_turns(self) -> bool:
        """Whether the hand's rotation is relative to the object's own axes."""
        return self.frame in ("o", "wo")


Anchors = tuple[Anchor, ...]
"""The anchor of one row in each demonstration."""
WORLD = Anchor("", "world")
START = Anchor("", "start")
NOT_TURNED = Rotation.identity()  # made once: that takes as long as rotating ten vectors


def in_frame(anchors: Anchors, frame: Frame) -> Anchors:
    """Return the anchors at the same objects in another frame."""
    return tuple(anchor._replace(frame=frame) for anchor in anchors)


def tilted_objects(scenes: Sequence[Query]) -> frozenset[str]:
    """Return the names of objects whose z axis is not vertical in some scene."""
    return frozenset(
        pose.name
        for scene in scenes
        for pose in scene.objects
        if pose.quaternion_xyzw is not None and tilt_rad(Rotation.from_quat(pose.quaternion_xyzw)) > TILT_RAD
    )


def object_rotation(pose: ObjectPose, frame: str, tilted: frozenset[str]) -> Rotation:
    """Return the axes of an object's frame in the world: the world's (`w`), its yaw, or a tilted object's rotation."""
    if frame == "w" or pose.quaternion_xyzw is None:
        return NOT_TURNED
    rotation = Rotation.from_quat(pose.quaternion_xyzw)
    return rotation if pose.name in tilted else Rotation.from_euler("z", yaw_rad(rotation))


class AnchorPose(NamedTuple):
    """An anchor in a scene, in the world frame.

    Attributes:
        origin_m: (3,).
        place_axes: along which positions are measured.
        hand_axes: relative to which the hand's rotations are.
    """

    origin_m: Array
    place_axes: Rotation
    hand_axes: Rotation

    def seen(self, positions_m: Array, hands: Rotation) -> tuple[Array, Rotation]:
        """Return poses of the hand, (3,) or (K, 3) in meters and as many rotations, relative to the anchor."""
        offsets_m: Array = self.place_axes.inv().apply(positions_m - self.origin_m)
        return offsets_m, self.hand_axes.inv() * hands

    def placed(self, offsets_m: Array, rotations: Rotation) -> tuple[Array, Rotation]:
        """Return poses of the hand in the world frame; the inverse of `seen`."""
        positions_m: Array = self.origin_m + self.place_axes.apply(offsets_m)
        return positions_m, self.hand_axes * rotations


def anchor_pose(anchor: Anchor, scene: Query, tilted: frozenset[str]) -> AnchorPose:
    """Return the pose of an anchor in a scene; a scene without `start` has none of the anchor `start`."""
    if anchor.frame == "world":
        return AnchorPose(np.zeros(3), NOT_TURNED, NOT_TURNED)
    if anchor.frame == "start":
        assert scene.start is not None
        return AnchorPose(scene.start.position_m, NOT_TURNED, NOT_TURNED)
    pose = scene.object(anchor.object_name)
    own = object_rotation(pose, anchor.frame, tilted)
    place_axes, hand_axes = (own if turns else NOT_TURNED for turns in (anchor.place_turns, anchor.hand_turns))
    origin_m = pose.position_m
    if anchor.along:
        origin_m = origin_m.copy()
        for axis, name in anchor.along:
            other_m = scene.object(name).position_m[axis] if name else 0.0
            origin_m[axis] += (anchor.tenths / 10 if name else 1.0) * (other_m - origin_m[axis])
    return AnchorPose(origin_m, place_axes, hand_axes)


def asked_anchor(anchor: Anchor, shown: Order, asked: Order) -> Anchor:
    """Return the anchor for another order: the objects that are mentioned in the same places."""
    along = tuple((axis, _asked_name(name, shown, asked)) for axis, name in anchor.along)
    return anchor._replace(object_name=_asked_name(anchor.object_name, shown, asked), along=along)


def _asked_name(name: str, shown: Order, asked: Order) -> str:
    place = shown.objects.index(name) if name in shown.objects else len(asked.objects)
    return asked.objects[place] if place < len(asked.objects) else name


def relative_action(
    demonstration: Demonstration, k: int, anchor: Anchor, tilted: frozenset[str]
) -> tuple[Array, Rotation]:
    """Return action `k` relative to the anchor: offset (3,) in meters along the anchor's axes, and rotation."""
    action = demonstration.actions[k]
    hand = Rotation.from_quat(action.quaternion_xyzw)
    return anchor_pose(anchor, demonstration, tilted).seen(action.position_m, hand)


def relative_poses(demonstration: Demonstration, anchor: Anchor, tilted: frozenset[str]) -> tuple[Array, Rotation]:
    """Return every action relative to the anchor: offsets (K, 3) in meters along its axes, and K rotations."""
    actions = demonstration.actions
    if not actions:
        return np.zeros((0, 3)), NOT_TURNED
    positions_m = np.array([action.position_m for action in actions])
    hands = Rotation.from_quat([action.quaternion_xyzw for action in actions])
    return anchor_pose(anchor, demonstration, tilted).seen(positions_m, hands)


def mixed_frames(group: Sequence[Demonstration], own: Anchors, tilted: frozenset[str]) -> dict[Anchors, list[int]]:
    """Return the rows in which only the position or only the rotation of the hand turns with an object, by frame.

    At least three demonstrations must contradict both frames `w` and `o`, one by the position and the other by the
    rotation: each scatters by `TURNED_M` or more along the wrong axes, and along the right ones by a share of it that
    is significantly small at level `CHANCE` (an F test of the variances of offsets in a plane from the most central
    demonstration; the share is 0.1 for three demonstrations, 0.34 for five, 0.49 for ten).

    Args:
        own: the objects' own frames.
    """
    if len(group) < MIN_TURNED or not group[0].actions:
        return {}
    certain = certain_share(len(group), 2)
    world_m, own_m = scatters_m(group, own, tilted)
    by_world, by_own = much_less(world_m, own_m, certain), much_less(own_m, world_m, certain)
    rows = np.stack([by_own[0] & by_world[1], by_world[0] & by_own[1]])
    found = zip(MIXED_FRAMES, rows, strict=True)
    return {in_frame(own, frame): np.flatnonzero(which).tolist() for frame, which in found if which.any()}


def certain_share(number: int, dimensions: int) -> float:
    """Return the share of a scatter that is small beyond chance (see `mixed_frames`), of offsets in 1 or 2 dimensions.

    Args:
        number: of demonstrations, `MIN_TURNED` or more.
    """
    half_freedom = dimensions * (deciding(number) - 2) / 2
    quantile = float(betaincinv(half_freedom, half_freedom, CHANCE))
    return min(TURNED_SHARE, math.sqrt(quantile / (1 - quantile)))


def scatters_m(group: Sequence[Demonstration], anchors: Anchors, tilted: frozenset[str]) -> tuple[Array, Array]:
    """Return the scatter of the hand relative to objects along the world's axes, and along the objects' own.

    Returns:
        Each (2, K) in meters: of positions, and of rotations (by `M_PER_RAD`).
    """
    world_m, own_m = (poses_scatter_m(group, in_frame(anchors, frame), tilted) for frame in OBJECT_FRAMES)
    return world_m, own_m


def much_less(off_m: Array, than_m: Array, share: float | Array) -> np.ndarray:
    """Return (...) bool: whether `than_m` counts, and `off_m` is smaller than this share of it and than `SERVES_M`."""
    return np.asarray((than_m >= TURNED_M) & (off_m < share * than_m) & (off_m < SERVES_M))


def poses_scatter_m(group: Sequence[Demonstration], anchors: Anchors, tilted: frozenset[str]) -> Array:
    """Return the scatter (2, K) of positions and rotations relative to the anchors.

    It is the rms distance from the most central demonstration; of many demonstrations the farthest fifth is left out.
    Heights do not count at upright objects, since a yaw does not change them.
    """
    relative = [relative_poses(d, anchor, tilted) for d, anchor in zip(group, anchors, strict=True)]
    offsets_m = np.array([offsets for offsets, _ in relative])  # (N, K, 3)
    if tilted.isdisjoint(anchor.object_name for anchor in anchors):
        offsets_m = offsets_m[..., :2]
    hands = np.array([rotations.as_quat() for _, rotations in relative])  # (N, K, 4)
    places_m = np.linalg.norm(offsets_m[:, None] - offsets_m[None], axis=3)
    turns_m = M_PER_RAD * quaternions.angles_rad(hands[:, None], hands)
    apart_m = np.sort(np.array([places_m, turns_m]), axis=2)
    scatter: Array = np.sqrt((apart_m[:, :, : deciding(len(group))] ** 2).mean(axis=2)).min(axis=1)
    return scatter


def deciding(number: int) -> int:
    """Return how many of `number` demonstrations are kept as inliers."""
    return math.ceil(DECIDING_SHARE * number) if number >= MANY_TURNED else number
