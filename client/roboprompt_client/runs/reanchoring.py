"""Move actions along with the objects that they refer to, without asking an LLM again."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from roboprompt_client.errors import UnsafeActionError
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

Poses = Mapping[str, ObjectPose]  # by object name
OBJECT_FRAMES = ("w", "o", "ow", "wo")
FRAMES = (*OBJECT_FRAMES, "world", "start")
UPRIGHT_RAD = math.radians(0.5)  # a frame that leans less is rotated about the vertical only
MOVED_M, MOVED_DEG = 0.005, 3.0  # an object has moved by more than this; less may be the estimator's noise


@dataclass(frozen=True, eq=False)
class ActionAnchor:
    """The object or frame that an action refers to, as `POST /predict` answers it.

    Attributes:
        object_name: None for the frames `world` and `start`, which do not move.
        frame: `w` is at the object's position with the world's axes, `o` with the object's own axes; `ow` has the
            object's axes for the offset and the world's for the rotation, `wo` the reverse.
        offset_m, rotation_xyzw: the action's pose (3,), (4,) in that frame.
        along: axes of the world (0 to 2) along which the position follows another object, or nothing (None).
        share: of the way from the object to the other one along these axes, where the frame is.
        toward: another object, to which the x axis of the object's axes then points; None: they are its own.
        axes, hand: objects by which the offset and the rotation turn, where that is other than `frame` says: one, by
            its own axes, two, by level axes of which x points from the first to the second, or none.
    """

    object_name: str | None
    frame: str
    offset_m: Array
    rotation_xyzw: Array
    along: Mapping[int, str | None] = field(default_factory=dict)
    share: float = 1.0
    toward: str | None = None
    axes: tuple[str, ...] | None = None
    hand: tuple[str, ...] | None = None

    @property
    def others(self) -> frozenset[str]:
        """The objects that it depends on besides its own."""
        every = (self.toward, *self.along.values(), *(self.axes or ()), *(self.hand or ()))
        return frozenset(filter(None, every)) - {self.object_name or ""}


def anchor_from_json(index: int, action: Mapping[str, Any]) -> ActionAnchor | None:
    """Return the anchor of an action of the service's answer, or None; raises UnsafeActionError if it is malformed."""
    if (item := action.get("anchor")) is None:
        return None
    try:
        name, frame, toward, share = item["object"], item["frame"], item.get("toward"), float(item.get("share", 1.0))
        along = {"xyz".index(axis): other for axis, other in item.get("along", {}).items()}
        offset_m, rotation_xyzw = np.array(item["offset_m"], float), np.array(item["rotation_xyzw"], float)
        valid = frame in FRAMES and (isinstance(name, str) if frame in OBJECT_FRAMES else name is None)
        valid = valid and offset_m.shape == (3,) and bool(np.isfinite(offset_m).all()) and 0 < share <= 1
        valid = valid and rotation_xyzw.shape == (4,) and abs(float(np.linalg.norm(rotation_xyzw)) - 1) < 1e-2
        axes, hand = (None if (names := item.get(key)) is None else tuple(names) for key in ("axes", "hand"))
        valid = valid and all(other is None or isinstance(other, str) for other in (toward, *along.values()))
        valid = valid and all(isinstance(other, str) for other in (*(axes or ()), *(hand or ())))
        valid = valid and max(len(axes or ()), len(hand or ())) <= 2
    except (AttributeError, KeyError, TypeError, ValueError):
        valid = False
    if not valid:
        raise UnsafeActionError(index, "anchor", f"is {item!r:.80}", "object, frame, offset_m, rotation_xyzw")
    return ActionAnchor(name, frame, offset_m, rotation_xyzw, along, share, toward, axes, hand)


def reanchored(
    actions: Sequence[EndEffectorAction],
    anchors: Sequence[ActionAnchor | None],
    before: Poses,
    now: Poses,
    yaw_symmetry_deg: Mapping[str, float],
) -> tuple[EndEffectorAction, ...]:
    """Return the actions; those that refer to moved objects are moved along, the others are the same instances.

    A symmetric object (`yaw_symmetry_deg` of the task) counts as rotated by the smallest angle that explains its pose,
    so that a cube never rotates a gripper by more than 45 degrees.

    Args:
        anchors: of each action; an action without an anchor stays.
        before: the poses for which the actions are right.
        now: the poses to follow; an object that is missing in either is not followed.
    """
    followed = []
    for action, anchor in zip(actions, anchors, strict=True):
        name = "" if anchor is None or anchor.object_name is None else anchor.object_name
        if anchor is None or (name and (name not in before or name not in now)):
            followed.append(action)
            continue
        moved = _moved_along(action, anchor, before, now, yaw_symmetry_deg.get(name)) if name else action
        followed.append(_turned_along(moved, anchor, before, now, yaw_symmetry_deg))
    return tuple(followed)


def has_moved(old: ObjectPose, new: ObjectPose, yaw_symmetry_deg: float | None) -> bool:
    """Return whether an object has another position, or another rotation that its symmetry does not explain."""
    if float(np.linalg.norm(new.position_m - old.position_m)) > MOVED_M:
        return True
    return math.degrees(rotations.angle_between_rad(*_axes(old, new, yaw_symmetry_deg))) > MOVED_DEG


def _moved_along(
    action: EndEffectorAction, anchor: ActionAnchor, before: Poses, now: Poses, symmetry_deg: float | None
) -> EndEffectorAction:
    old, new = (objects[str(anchor.object_name)] for objects in (before, now))
    new = new if has_moved(old, new, symmetry_deg) else old
    from_m, to_m = _origin_m(anchor, old, before, now), _origin_m(anchor, new, now, before)
    if anchor.toward is None:
        was, is_ = _axes(old, new, symmetry_deg)
    else:
        was, is_ = _axes_toward(old, new, before.get(anchor.toward), now.get(anchor.toward))
    if np.array_equal(from_m, to_m) and np.array_equal(was, is_):
        return action
    offset_m = action.position_m - from_m
    if _is_upright(action, anchor, offset_m):
        turn = rotations.about_z(rotations.yaw_rad(is_) - rotations.yaw_rad(was))
    else:
        turn = rotations.product(is_, rotations.inverse(was))
    if anchor.frame in ("o", "ow"):
        offset_m = rotations.rotated(turn, offset_m)
    hand_turn = turn if anchor.frame in ("o", "wo") else rotations.IDENTITY
    turned = rotations.canonical(_unit(rotations.product(hand_turn, action.quaternion_xyzw)))
    return EndEffectorAction(to_m + offset_m, turned, action.gripper_open)


def _turned_along(
    action: EndEffectorAction, anchor: ActionAnchor, before: Poses, now: Poses, symmetry_deg: Mapping[str, float]
) -> EndEffectorAction:
    """Return an action whose origin has moved along, turned by what else it turns with."""
    if not (anchor.axes or anchor.hand):
        return action
    place_turn, hand_turn = (_turn_of(names or (), before, now, symmetry_deg) for names in (anchor.axes, anchor.hand))
    origin_m = np.zeros(3)
    if anchor.object_name is not None:
        origin_m = _origin_m(anchor, now[anchor.object_name], now, before)
    turned = rotations.canonical(_unit(rotations.product(hand_turn, action.quaternion_xyzw)))
    position_m = origin_m + rotations.rotated(place_turn, action.position_m - origin_m)
    return EndEffectorAction(position_m, turned, action.gripper_open)


def _turn_of(names: tuple[str, ...], before: Poses, now: Poses, symmetry_deg: Mapping[str, float]) -> Array:
    """Return the rotation (4,) by which axes have turned; none where an object is not seen before and now."""
    if not names or any(name not in before or name not in now for name in names):
        return rotations.IDENTITY
    old, new = before[names[0]], now[names[0]]
    if len(names) == 1:
        was, is_ = _axes(old, new, symmetry_deg.get(names[0]))
    else:
        was, is_ = _axes_toward(old, new, before[names[1]], now[names[1]])
    return rotations.product(is_, rotations.inverse(was))


def _origin_m(anchor: ActionAnchor, pose: ObjectPose, objects: Poses, others: Poses) -> Array:
    """Return what positions are relative to, (3,): along some axes another object, or the world where there is none.

    Args:
        others: those of the other moment; an object that one of both lacks is not followed.
    """
    origin_m = pose.position_m.copy()
    for axis, name in anchor.along.items():
        if name is not None and name in objects and name in others:
            origin_m[axis] += anchor.share * (objects[name].position_m[axis] - origin_m[axis])
        else:
            origin_m[axis] = 0.0
    return origin_m


def _is_upright(action: EndEffectorAction, anchor: ActionAnchor, offset_m: Array) -> bool:
    """Return whether the anchor frame rotates about the vertical only, so that heights stay the same."""
    if anchor.frame == "ow":
        leans_m = abs(float(offset_m[2] - anchor.offset_m[2]))
        return leans_m <= UPRIGHT_RAD * float(np.linalg.norm(offset_m))
    axes = rotations.product(action.quaternion_xyzw, rotations.inverse(_unit(anchor.rotation_xyzw)))
    return rotations.tilt_rad(axes) < UPRIGHT_RAD


def _axes(old: ObjectPose, new: ObjectPose, symmetry_deg: float | None) -> tuple[Array, Array]:
    """Return an object's rotations before and now, where the symmetry's choice now is the nearest to before."""
    if old.quaternion_xyzw is None or new.quaternion_xyzw is None:
        return rotations.IDENTITY, rotations.IDENTITY
    was, is_ = old.quaternion_xyzw, new.quaternion_xyzw
    if new is old:
        return was, was  # exactly: rounding would turn a round object by 1e-17
    hidden = _nearest_symmetry(rotations.product(rotations.inverse(is_), was), symmetry_deg)
    return was, rotations.product(is_, hidden)


def _axes_toward(
    old: ObjectPose, new: ObjectPose, other_before: ObjectPose | None, other_now: ObjectPose | None
) -> tuple[Array, Array]:
    """Return level axes before and now, (4,) each, of which x points from an object to another one.

    Where the other one is not seen now, it is taken to stand as before; without a pose before the axes do not turn.
    """
    if other_before is None:
        return rotations.IDENTITY, rotations.IDENTITY
    moved = other_now is not None and has_moved(other_before, other_now, None)
    other_new = other_now if other_now is not None and moved else other_before
    ways_m = other_before.position_m - old.position_m, other_new.position_m - new.position_m
    was, is_ = (rotations.about_z(math.atan2(way_m[1], way_m[0])) for way_m in ways_m)
    return was, is_


def _unit(rotation: Array) -> Array:
    unit: Array = rotation / np.linalg.norm(rotation)
    return unit


def _nearest_symmetry(rotation: Array, symmetry_deg: float | None) -> Array:
    """Return the rotation about z that the symmetry allows and that is nearest to `rotation`."""
    if symmetry_deg is None:
        return rotations.IDENTITY
    _, _, z, w = rotation
    twist_deg = math.degrees(2 * math.atan2(z, w))
    hidden_deg = twist_deg if symmetry_deg == 0 else symmetry_deg * round(twist_deg / symmetry_deg)
    return rotations.about_z(math.radians(hidden_deg))
