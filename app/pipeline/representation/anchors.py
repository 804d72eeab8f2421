"""What an action is relative to: an object, the world, or the arm's start; and where that is in a scene.

At an object the hand's place and its rotation each have axes of their own, the object's or the world's. Mostly both
turn with the object or neither does. A hand that presses the rim of a mug, however the mug is turned, keeps its own
rotation while its place turns; one that turns with a valve and stays on the robot's side of it does the reverse.
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
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

Frame = Literal["w", "o", "ow", "wo", "world", "start"]
OBJECT_FRAMES: tuple[Frame, ...] = ("w", "o")
MIXED_FRAMES: tuple[Frame, ...] = ("ow", "wo")
TILT_RAD = math.radians(5)  # an object that leans more than this in any demonstration turns its frame fully
M_PER_RAD = 0.06  # 10 degrees of rotation weigh as much as 1 cm of position
MANY_TURNED = 8  # demonstrations, from which on those that are farthest off do not decide, but
DECIDING_SHARE = 0.8  # this share of them: of fewer one that is turned as no other may say most
MIN_TURNED = 3  # demonstrations that show what turns with an object
TURNED_M = 0.006  # scatter (rms) along the wrong axes that matters; of rotations 6 degrees
TURNED_SHARE = 0.6  # of it, at most, is left along the right axes, and of few as little as noise leaves by `CHANCE`;
SERVES_M = 0.02  # and no more than this: rows on the way that scatter about everything have no axes
CHANCE = 0.01


class Anchor(NamedTuple):
    """What an action is relative to.

    Attributes:
        object_name: empty for the frames `world` and `start`.
        frame: at the object's position `w`, world axes, or `o`, the object's own axes; `ow`: its own for the hand's
            place and the world's for its rotation, `wo` the reverse; `world`: the world frame itself; `start`: where
            the end effector was at first, world axes.
    """

    object_name: str
    frame: Frame

    @property
    def place_turns(self) -> bool:
        """Whether the hand's place is along the object's own axes."""
        return self.frame in ("o", "ow")

    @property
    def hand_turns(self) -> bool:
        """Whether the hand's rotation is."""
        return self.frame in ("o", "wo")


Anchors = tuple[Anchor, ...]
"""Of one row, each demonstration's."""
WORLD = Anchor("", "world")
START = Anchor("", "start")
NOT_TURNED = Rotation.identity()  # to make one takes as long as to turn ten vectors


def in_frame(anchors: Anchors, frame: Frame) -> Anchors:
    """A frame of the same objects."""
    return tuple(Anchor(anchor.object_name, frame) for anchor in anchors)


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


class AnchorPose(NamedTuple):
    """An anchor in a scene, in the world frame.

    Attributes:
        origin_m: (3,).
        place_axes: along which places are.
        hand_axes: from which the hand's rotations are.
    """

    origin_m: Array
    place_axes: Rotation
    hand_axes: Rotation

    def seen(self, positions_m: Array, hands: Rotation) -> tuple[Array, Rotation]:
        """Poses of the hand, (3,) or (K, 3) in meters and as many rotations, relative to the anchor."""
        offsets_m: Array = self.place_axes.inv().apply(positions_m - self.origin_m)
        return offsets_m, self.hand_axes.inv() * hands

    def placed(self, offsets_m: Array, rotations: Rotation) -> tuple[Array, Rotation]:
        """The way back."""
        positions_m: Array = self.origin_m + self.place_axes.apply(offsets_m)
        return positions_m, self.hand_axes * rotations


def anchor_pose(anchor: Anchor, scene: Query, tilted: frozenset[str]) -> AnchorPose:
    """Where an anchor is in a scene, which knows where the end effector was at first, if that is the anchor."""
    if anchor.frame == "world":
        return AnchorPose(np.zeros(3), NOT_TURNED, NOT_TURNED)
    if anchor.frame == "start":
        assert scene.start is not None
        return AnchorPose(scene.start.position_m, NOT_TURNED, NOT_TURNED)
    pose = scene.object(anchor.object_name)
    own = object_rotation(pose, anchor.frame, tilted)
    place_axes, hand_axes = (own if turns else NOT_TURNED for turns in (anchor.place_turns, anchor.hand_turns))
    return AnchorPose(pose.position_m, place_axes, hand_axes)


def asked_anchor(anchor: Anchor, shown: Order, asked: Order) -> Anchor:
    """The anchor of a demonstration in a scene with another order: the object mentioned in the same place."""
    if anchor.object_name in shown.objects:
        place = shown.objects.index(anchor.object_name)
        if place < len(asked.objects):
            return Anchor(asked.objects[place], anchor.frame)
    return anchor


def relative_action(
    demonstration: Demonstration, k: int, anchor: Anchor, tilted: frozenset[str]
) -> tuple[Array, Rotation]:
    """Action `k` relative to the anchor: offset (3,) in meters along the anchor's axes, and rotation."""
    action = demonstration.actions[k]
    hand = Rotation.from_quat(action.quaternion_xyzw)
    return anchor_pose(anchor, demonstration, tilted).seen(action.position_m, hand)


def relative_poses(demonstration: Demonstration, anchor: Anchor, tilted: frozenset[str]) -> tuple[Array, Rotation]:
    """Every action relative to the anchor: offsets (K, 3) in meters along its axes, and K rotations."""
    actions = demonstration.actions
    if not actions:
        return np.zeros((0, 3)), NOT_TURNED
    positions_m = np.array([action.position_m for action in actions])
    hands = Rotation.from_quat([action.quaternion_xyzw for action in actions])
    return anchor_pose(anchor, demonstration, tilted).seen(positions_m, hands)


def mixed_frames(group: Sequence[Demonstration], own: Anchors, tilted: frozenset[str]) -> dict[Anchors, list[int]]:
    """The rows in which only place or only rotation of the hand turns with an object, by the frame that says so.

    Three demonstrations or more must contradict both frames of the object, one by the place and the other by the hand's
    rotation: either scatters by `TURNED_M` along the wrong axes, and along the right ones by so small a share of it
    that of independent scatters one would be as small once in a hundred times (an F test of the variances of offsets in
    a plane from a demonstration among them: 0.1 of three demonstrations, 0.34 of five, 0.49 of ten). Noise is the same
    along both axes, so that it passes far less often.

    Args:
        own: the objects' own frames.
    """
    if len(group) < MIN_TURNED or not group[0].actions:
        return {}
    freedom = _deciding(len(group)) - 2  # half of that of offsets in a plane
    quantile = float(betaincinv(freedom, freedom, CHANCE))
    certain = min(TURNED_SHARE, math.sqrt(quantile / (1 - quantile)))
    world_m, own_m = scatters_m(group, own, tilted)
    by_world, by_own = much_less(world_m, own_m, certain), much_less(own_m, world_m, certain)
    rows = np.stack([by_own[0] & by_world[1], by_world[0] & by_own[1]])
    found = zip(MIXED_FRAMES, rows, strict=True)
    return {in_frame(own, frame): np.flatnonzero(which).tolist() for frame, which in found if which.any()}


def scatters_m(group: Sequence[Demonstration], anchors: Anchors, tilted: frozenset[str]) -> tuple[Array, Array]:
    """How far the hand scatters along the world's axes at some objects, and along the objects' own.

    Returns:
        Of each (2, K) in meters: the hand's places, and its rotations weighed as elsewhere.
    """
    world_m, own_m = (_scatter_m(group, in_frame(anchors, frame), tilted) for frame in OBJECT_FRAMES)
    return world_m, own_m


def much_less(off_m: Array, than_m: Array, share: float | Array) -> np.ndarray:
    """(...) bool: whether a scatter is so small a share of one that matters."""
    return np.asarray((than_m >= TURNED_M) & (off_m < share * than_m) & (off_m < SERVES_M))


def _scatter_m(group: Sequence[Demonstration], anchors: Anchors, tilted: frozenset[str]) -> Array:
    """(2, K) how far places and rotations scatter relative to the anchors.

    It is the rms distance from the most central demonstration; of many, without the fifth that is farthest from it.
    An upright object turns no heights: these do not count.
    """
    relative = [relative_poses(d, anchor, tilted) for d, anchor in zip(group, anchors, strict=True)]
    offsets_m = np.array([offsets for offsets, _ in relative])  # (N, K, 3)
    if tilted.isdisjoint(anchor.object_name for anchor in anchors):
        offsets_m = offsets_m[..., :2]
    quaternions = np.array([rotations.as_quat() for _, rotations in relative])  # (N, K, 4)
    cosines = np.abs(np.einsum("ikq,jkq->ijk", quaternions, quaternions))
    places_m = np.linalg.norm(offsets_m[:, None] - offsets_m[None], axis=3)
    apart_m = np.sort(np.array([places_m, 2 * M_PER_RAD * np.arccos(np.minimum(cosines, 1))]), axis=2)
    scatter: Array = np.sqrt((apart_m[:, :, : _deciding(len(group))] ** 2).mean(axis=2)).min(axis=1)
    return scatter


def _deciding(number: int) -> int:
    """Of so many demonstrations those that decide."""
    return math.ceil(DECIDING_SHARE * number) if number >= MANY_TURNED else number
