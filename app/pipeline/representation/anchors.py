"""Anchors: the object, the world, or the arm's start that an action is relative to; and their poses in a scene.

At an object the hand's position and its rotation are each relative to the object's axes or to the world's. Usually
both turn with the object, or neither. A hand that presses the rim of a mug above its handle keeps its rotation while
its position turns with the mug; one that turns with a valve but stays on the robot's side of it does the reverse.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration, Query
from app.pipeline.order.order import Order
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

AnchorFrame = Literal["w", "o", "ow", "wo", "world", "start"]
AXES = "xyz"
OBJECT_FRAMES: tuple[AnchorFrame, ...] = ("w", "o")
MIXED_FRAMES: tuple[AnchorFrame, ...] = ("ow", "wo")
CLEAR_TILT_RAD = math.radians(12)  # the paper's noise of poses exceeds it in one of 5000
TILT_RAD = math.radians(5)  # the frame of an object that leans by more has its full rotation, not only its yaw


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
        toward: another object, to which the x axis of the object's own axes then points; empty: they are its own.
        tilted: objects whose own axes have their full rotation; of others they have the yaw alone.
    """

    object_name: str
    frame: AnchorFrame
    along: tuple[tuple[int, str], ...] = ()
    tenths: int = 10
    tilted: frozenset[str] = frozenset()
    toward: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """All objects that it depends on, the one that it is at first."""
        every = (self.object_name, self.toward, *(name for _, name in self.along))
        return tuple(name for name in dict.fromkeys(every) if name)

    @property
    def is_of_several(self) -> bool:
        """Whether it depends on more than one object, or on an object and the world."""
        return bool(self.along or self.toward)

    @property
    def described(self) -> str:
        """What it follows, in words: `block`, `block toward goal`, `cup, z of the world`, `the start`."""
        if not self.object_name:
            return f"the {self.frame}"
        if self.toward:
            return f"{self.object_name} toward {self.toward}"
        return ", ".join([self.object_name, *(f"{AXES[axis]} of {name or 'the world'}" for axis, name in self.along)])

    @property
    def others_text(self) -> str:
        """What else it follows, as rows write it: ` z=world`, ` x=B y=B 5/10`, `>B`."""
        if self.toward:
            return f">{self.toward}"
        along = "".join(f" {AXES[axis]}={name or 'world'}" for axis, name in self.along)
        return along if self.tenths == 10 else f"{along} {self.tenths}/10"

    @property
    def place_turns(self) -> bool:
        """Whether the hand's position is along the object's own axes."""
        return self.frame in ("o", "ow")

    @property
    def hand_turns(self) -> bool:
        """Whether the hand's rotation is relative to the object's own axes."""
        return self.frame in ("o", "wo")

    @property
    def at_tilted(self) -> bool:
        """Whether its object is tilted."""
        return self.object_name in self.tilted

    def named(self, names: Mapping[str, str]) -> "Anchor":
        """The anchor with objects under other names; those that are not in `names` keep theirs."""
        along = tuple((axis, names.get(name, name)) for axis, name in self.along)
        own, toward = (names.get(name, name) for name in (self.object_name, self.toward))
        return self._replace(object_name=own, along=along, toward=toward)

    def axes_of(self, pose: ObjectPose) -> Array:
        """(4,) the axes of its object at a pose, in the world: for the frame `w` the world's."""
        if self.frame == "w" or pose.quaternion_xyzw is None:
            return quaternions.IDENTITY
        if pose.name in self.tilted:
            return pose.quaternion_xyzw
        return quaternions.about_z(quaternions.yaw_rad(pose.quaternion_xyzw))


Anchors = tuple[Anchor, ...]
"""The anchor of one row in each demonstration."""
WORLD = Anchor("", "world")
START = Anchor("", "start")
NOT_TURNED = Rotation.identity()  # made once: that takes as long as rotating ten vectors


def names_of(anchors: Anchors) -> tuple[str, ...]:
    """Return the objects' names; all empty for the world and the start."""
    return tuple(anchor.object_name for anchor in anchors)


def in_frame(anchors: Anchors, frame: AnchorFrame) -> Anchors:
    """Return the anchors at the same objects in another frame."""
    return tuple(anchor._replace(frame=frame) for anchor in anchors)


def tilted_objects(scenes: Sequence[Query]) -> frozenset[str]:
    """Return the names of objects whose z axis is not vertical, in most scenes, or clearly in one."""
    tilts_rad: dict[str, list[float]] = defaultdict(list)
    for scene in scenes:
        for pose in scene.objects:
            if pose.quaternion_xyzw is not None:
                tilts_rad[pose.name].append(quaternions.tilt_rad(pose.quaternion_xyzw))
    return frozenset(
        name for name, found in tilts_rad.items() if median(found) > TILT_RAD or max(found) > CLEAR_TILT_RAD
    )


class AnchorPose(NamedTuple):
    """An anchor in a scene, in the world frame; or N anchors, each with an origin and axes of its own.

    Attributes:
        origin_m: (3,) or (N, 3).
        place_axes_xyzw: (4,) or (N, 4), along which positions are measured.
        hand_axes_xyzw: (4,) or (N, 4), relative to which the hand's rotations are.
    """

    origin_m: Array
    place_axes_xyzw: Array
    hand_axes_xyzw: Array

    @classmethod
    def stacked(cls, poses: Iterable["AnchorPose"]) -> "AnchorPose":
        """Return N anchors as one."""
        return cls(*map(np.array, zip(*poses, strict=True)))

    def seen(self, positions_m: Array, hands: Rotation) -> tuple[Array, Rotation]:
        """Return poses of the hand, (3,) or (K, 3) in meters and as many rotations, relative to the anchor.

        K poses of one anchor, or one pose of each of K anchors.
        """
        offsets_m: Array = Rotation.from_quat(self.place_axes_xyzw).apply(positions_m - self.origin_m, inverse=True)
        return offsets_m, Rotation.from_quat(self.hand_axes_xyzw).inv() * hands

    def placed(self, offsets_m: Array, rotations: Rotation) -> tuple[Array, Rotation]:
        """Return poses of the hand in the world frame; the inverse of `seen`."""
        positions_m: Array = self.origin_m + Rotation.from_quat(self.place_axes_xyzw).apply(offsets_m)
        return positions_m, Rotation.from_quat(self.hand_axes_xyzw) * rotations


def anchor_pose(anchor: Anchor, scene: Query) -> AnchorPose:
    """Return the pose of an anchor in a scene; a scene without `start` has none of the anchor `start`."""
    if anchor.frame == "world":
        return AnchorPose(np.zeros(3), quaternions.IDENTITY, quaternions.IDENTITY)
    if anchor.frame == "start":
        assert scene.start is not None
        return AnchorPose(scene.start.position_m, quaternions.IDENTITY, quaternions.IDENTITY)
    pose = scene.object(anchor.object_name)
    own = _axes_toward(pose, scene.object(anchor.toward)) if anchor.toward else anchor.axes_of(pose)
    axes = (own if turns else quaternions.IDENTITY for turns in (anchor.place_turns, anchor.hand_turns))
    origin_m = pose.position_m
    if anchor.along:
        origin_m = origin_m.copy()
        for axis, name in anchor.along:
            other_m = scene.object(name).position_m[axis] if name else 0.0
            origin_m[axis] += (anchor.tenths / 10 if name else 1.0) * (other_m - origin_m[axis])
    return AnchorPose(origin_m, *axes)


def _axes_toward(pose: ObjectPose, other: ObjectPose) -> Array:
    """Return (4,) level axes of which x points from one object to the other."""
    x_m, y_m, _ = other.position_m - pose.position_m
    return quaternions.about_z(math.atan2(y_m, x_m))


def anchor_poses(anchors: Anchors, scenes: Sequence[Query]) -> AnchorPose:
    """Return the poses of anchors, each in its scene."""
    return AnchorPose.stacked(map(anchor_pose, anchors, scenes))


def asked_anchor(anchor: Anchor, shown: Order, asked: Order) -> Anchor:
    """Return the anchor for another order: the objects that are mentioned in the same places."""
    return anchor.named(dict(zip(shown.objects, asked.objects, strict=False)))


def hand_poses(actions: Sequence[EndEffectorAction]) -> tuple[Array, Rotation]:
    """Return the hand's positions (K, 3) in the world frame, in meters, and its K rotations."""
    if not actions:
        return np.zeros((0, 3)), NOT_TURNED
    positions_m = np.array([action.position_m for action in actions])
    return positions_m, Rotation.from_quat([action.quaternion_xyzw for action in actions])


def relative_row(group: Sequence[Demonstration], k: int, anchors: Anchors) -> tuple[Array, Rotation]:
    """Return action `k` of each demonstration relative to its anchor: offsets (N, 3) in meters, and N rotations."""
    return anchor_poses(anchors, group).seen(*hand_poses([demonstration.actions[k] for demonstration in group]))
