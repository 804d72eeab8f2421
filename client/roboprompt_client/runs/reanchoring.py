"""Actions follow the objects that they refer to when these are moved, without asking an LLM again."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from roboprompt_client.errors import UnsafeActionError
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

OBJECT_FRAMES = ("w", "o", "ow", "wo")
FRAMES = (*OBJECT_FRAMES, "world", "start")
UPRIGHT_RAD = math.radians(0.5)  # a frame that leans less is turned about the vertical alone


class Moved(NamedTuple):
    """The change from which on an object counts as moved; a smaller one may be the estimator's noise."""

    position_m: float = 0.005
    rotation_deg: float = 3.0


MOVED = Moved()


@dataclass(frozen=True, eq=False)
class ActionAnchor:
    """The object or frame that an action refers to, as `POST /predict` answers it.

    Attributes:
        object_name: None for the frames `world` and `start`, which do not move.
        frame: `w` at the object's position, world axes; `o`: axes that turn with the object; `ow`: these for the offset
            and the world's for the rotation; `wo`: the reverse.
        offset_m, rotation_xyzw: the action's pose (3,), (4,) in that frame.
        tolerance_m, tolerance_deg: within which most demonstrations lie.
    """

    object_name: str | None
    frame: str
    offset_m: Array
    rotation_xyzw: Array
    tolerance_m: float = math.inf
    tolerance_deg: float = math.inf


def anchor_from_json(index: int, action: Mapping[str, Any]) -> ActionAnchor | None:
    """The anchor of an action as the service sends it; None where it sends none.

    Raises:
        UnsafeActionError: if it is there and no anchor.
    """
    if (item := action.get("anchor")) is None:
        return None
    try:
        name, frame = item["object"], item["frame"]
        offset_m, rotation_xyzw = np.array(item["offset_m"], float), np.array(item["rotation_xyzw"], float)
        tolerance_m, tolerance_deg = float(item["tolerance_m"]), float(item["tolerance_deg"])
        valid = frame in FRAMES and (isinstance(name, str) if frame in OBJECT_FRAMES else name is None)
        valid = valid and offset_m.shape == (3,) and bool(np.isfinite(offset_m).all())
        valid = valid and rotation_xyzw.shape == (4,) and abs(float(np.linalg.norm(rotation_xyzw)) - 1) < 1e-2
    except (KeyError, TypeError, ValueError):
        valid = False
    if not valid:
        raise UnsafeActionError(index, "anchor", f"is {item!r:.80}", "object, frame, offset_m, rotation_xyzw")
    return ActionAnchor(name, frame, offset_m, rotation_xyzw, tolerance_m, tolerance_deg)


def reanchored(
    actions: Sequence[EndEffectorAction],
    anchors: Sequence[ActionAnchor | None],
    before: Mapping[str, ObjectPose],
    now: Mapping[str, ObjectPose],
    yaw_symmetry_deg: Mapping[str, float],
    threshold: Moved = MOVED,
) -> tuple[EndEffectorAction, ...]:
    """The actions, those that refer to moved objects moved along; the others are the same instances.

    An object that looks the same after a turn (`yaw_symmetry_deg` of the task) counts as turned by the least angle that
    explains what is seen, so that a cube never turns a gripper by more than 45 degrees.

    Args:
        anchors: of each action; one without an anchor stays.
        before: by name, the poses for which the actions are right.
        now: by name, the poses to follow; an object that is missing in either is not followed.
    """
    followed = []
    for action, anchor in zip(actions, anchors, strict=True):
        name = "" if anchor is None or anchor.object_name is None else anchor.object_name
        if anchor is None or name not in before or name not in now:
            followed.append(action)
            continue
        old, new, symmetry_deg = before[name], now[name], yaw_symmetry_deg.get(name)
        moves = has_moved(old, new, symmetry_deg, threshold)
        followed.append(_moved_along(action, anchor, old, new, symmetry_deg) if moves else action)
    return tuple(followed)


def has_moved(old: ObjectPose, new: ObjectPose, yaw_symmetry_deg: float | None, threshold: Moved = MOVED) -> bool:
    """Whether an object lies elsewhere, or is turned by more than its symmetry hides."""
    if float(np.linalg.norm(new.position_m - old.position_m)) > threshold.position_m:
        return True
    was, is_ = _axes(old, new, yaw_symmetry_deg)
    return math.degrees(rotations.angle_between_rad(was, is_)) > threshold.rotation_deg


def _moved_along(
    action: EndEffectorAction,
    anchor: ActionAnchor,
    old: ObjectPose,
    new: ObjectPose,
    symmetry_deg: float | None,
) -> EndEffectorAction:
    was, is_ = _axes(old, new, symmetry_deg)
    offset_m = action.position_m - old.position_m
    if _is_upright(action, anchor, offset_m):
        turn = rotations.about_z(rotations.yaw_rad(is_) - rotations.yaw_rad(was))
    else:
        turn = rotations.product(is_, rotations.inverse(was))
    if anchor.frame in ("o", "ow"):
        offset_m = rotations.rotated(turn, offset_m)
    hand_turn = turn if anchor.frame in ("o", "wo") else rotations.IDENTITY
    turned = rotations.canonical(_unit(rotations.product(hand_turn, action.quaternion_xyzw)))
    return EndEffectorAction(new.position_m + offset_m, turned, action.gripper_open)


def _is_upright(action: EndEffectorAction, anchor: ActionAnchor, offset_m: Array) -> bool:
    """Whether the axes of a frame that turns with its object turn about the vertical alone: then heights stay."""
    if anchor.frame == "ow":
        leans_m = abs(float(offset_m[2] - anchor.offset_m[2]))
        return leans_m <= UPRIGHT_RAD * float(np.linalg.norm(offset_m))
    axes = rotations.product(action.quaternion_xyzw, rotations.inverse(_unit(anchor.rotation_xyzw)))
    return rotations.tilt_rad(axes) < UPRIGHT_RAD


def _axes(old: ObjectPose, new: ObjectPose, symmetry_deg: float | None) -> tuple[Array, Array]:
    """An object's axes in the world as they were, and of those that they may be now the nearest to them."""
    if old.quaternion_xyzw is None or new.quaternion_xyzw is None:
        return rotations.IDENTITY, rotations.IDENTITY
    was, is_ = old.quaternion_xyzw, new.quaternion_xyzw
    hidden = _hidden_turn(rotations.product(rotations.inverse(is_), was), symmetry_deg)
    return was, rotations.product(is_, hidden)


def _unit(rotation: Array) -> Array:
    unit: Array = rotation / np.linalg.norm(rotation)
    return unit


def _hidden_turn(rotation: Array, symmetry_deg: float | None) -> Array:
    """The turn about z, of those that the symmetry hides, that is nearest to a rotation."""
    if symmetry_deg is None:
        return rotations.IDENTITY
    _, _, z, w = rotation
    twist_deg = math.degrees(2 * math.atan2(z, w))
    hidden_deg = twist_deg if symmetry_deg == 0 else symmetry_deg * round(twist_deg / symmetry_deg)
    return rotations.about_z(math.radians(hidden_deg))
