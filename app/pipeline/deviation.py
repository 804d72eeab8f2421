"""Distances of a predicted scene and its actions from the demonstrations, relative to the objects."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.plans.rows import PlanRow, plan_rows
from app.pipeline.representation.anchors import asked_anchor, relative_row
from roboprompt_client.types.poses import ObjectPose


@dataclass(frozen=True)
class ObjectReach:
    """The distance of an object from its places in the demonstrations.

    Attributes:
        nearest_m: to its place in the nearest demonstration.
        nearest_deg: the least angle to its rotation in a demonstration; None if a rotation is unknown.
        beyond_m: outside the box that holds its places in all demonstrations, along the farthest axis; 0 inside.
    """

    nearest_m: float
    nearest_deg: float | None
    beyond_m: float


@dataclass(frozen=True)
class ActionDeviation:
    """The difference of an action from the same action of the demonstrations, relative to what it follows.

    Attributes:
        follows: in words, see `Anchor.described`.
        offset_m: from the demonstrations' median place.
        spread_m: of the farthest demonstration from there.
        turn_deg, turn_spread_deg: the same of the rotation, from their mean rotation.
    """

    follows: str
    offset_m: float
    spread_m: float
    turn_deg: float
    turn_spread_deg: float


def object_reach(pose: ObjectPose, demonstrations: Sequence[Demonstration]) -> ObjectReach:
    """The distance of an object from its places in demonstrations, at least one, all of which have it."""
    shown = [demonstration.object(pose.name) for demonstration in demonstrations]
    places_m = np.array([item.position_m for item in shown])
    beyond_m = np.maximum(pose.position_m - places_m.max(axis=0), places_m.min(axis=0) - pose.position_m)
    turns_deg = [_turn_deg(pose, item) for item in shown]
    known_deg = [turn for turn in turns_deg if turn is not None]
    nearest_m = float(np.linalg.norm(places_m - pose.position_m, axis=1).min())
    return ObjectReach(nearest_m, min(known_deg, default=None), max(float(beyond_m.max()), 0.0))


def action_deviations(predicted: Demonstration, demonstrations: Sequence[Demonstration]) -> tuple[ActionDeviation, ...]:
    """The deviation of each action of `predicted` from demonstrations of the same form with as many actions, if any."""
    asked = predicted.order.form, len(predicted.actions)
    group = [shown for shown in demonstrations if (shown.order.form, len(shown.actions)) == asked]
    if not group or not predicted.actions:
        return ()
    if predicted.start is None:
        group = [replace(shown, start=None) for shown in group]  # no row can then follow the start
    return tuple(_deviation(predicted, group[0], k, row) for k, row in enumerate(plan_rows(group)))


def _deviation(predicted: Demonstration, shown: Demonstration, k: int, row: PlanRow) -> ActionDeviation:
    own = asked_anchor(row.anchors[0], shown.order, predicted.order)
    if own.object_name and not own.toward and predicted.object(own.object_name).quaternion_xyzw is None:
        own = own._replace(frame="w")
    (offset_m,), rotation = relative_row([predicted], k, (own,))
    center_m, mean = np.median(row.offsets_m, axis=0), row.rotations.mean()
    return ActionDeviation(
        own.described,
        float(np.linalg.norm(offset_m - center_m)),
        float(np.linalg.norm(row.offsets_m - center_m, axis=1).max()),
        float(np.degrees((mean.inv() * rotation[0]).magnitude())),
        float(np.degrees((mean.inv() * row.rotations).magnitude().max())),
    )


def _turn_deg(one: ObjectPose, other: ObjectPose) -> float | None:
    if one.quaternion_xyzw is None or other.quaternion_xyzw is None:
        return None
    turn = Rotation.from_quat(one.quaternion_xyzw).inv() * Rotation.from_quat(other.quaternion_xyzw)
    return float(np.degrees(turn.magnitude()))
