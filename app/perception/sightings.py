"""The poses that single cameras give an object -> one pose, or an error that says what each camera saw."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery
from app.perception.object_model import MIN_CONFIDENCE
from app.pipeline.errors import ObjectNotVisibleError, UncertainPoseError
from app.pipeline.geometry import canonical_pose, canonical_rotation
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

NOTED_DISTANCE_M = 0.01  # cameras that differ by more are mentioned in the pose's reason
MAX_DISTANCE_M = 0.03  # by more than this, no pose is given: one of them must be wrong
NOTED_TURN_DEG, MAX_TURN_DEG = 8.0, 20.0  # the same for rotations
REMEDY = "a view that shows all of it and no similar object, or a further camera"


@dataclass(frozen=True, eq=False)
class Sighting:
    """An object as one camera sees it.

    Attributes:
        position_m: (3,) in the world frame.
        quaternion_xyzw: (4,) in the world frame, or None.
        confidence: 0..1.
        reason: what lowers the confidence, in words; empty if nothing.
    """

    camera: str
    position_m: Array
    quaternion_xyzw: Array | None
    confidence: float
    reason: str = ""


@dataclass(frozen=True)
class Miss:
    """A camera that has no pose of an object to offer, and why.

    Attributes:
        seen: whether the camera has seen something that might be it.
    """

    camera: str
    reason: str
    seen: bool = False


def fused(
    query: ObjectQuery,
    found: Sequence[Sighting | Miss],
    *,
    estimator: str,
    min_confidence: float = MIN_CONFIDENCE,
    yaw_symmetry_deg: float | None = None,
) -> ObjectPose:
    """One pose from the sightings that are confident enough, weighted by their confidence.

    Rotations are averaged after each was turned, under the object's symmetry, to the one nearest the best sighting's;
    the result is canonical (`app.pipeline.geometry.canonical_pose`). A pose without rotation results where any of the
    sightings that count has none.

    Args:
        yaw_symmetry_deg: as for `canonical_pose`.

    Raises:
        ObjectNotVisibleError: if no camera sees the object.
        UncertainPoseError: if none is confident enough, or they contradict each other. Both name object and cameras.
    """
    sightings = [item for item in found if isinstance(item, Sighting)]
    good = sorted((s for s in sightings if s.confidence >= min_confidence), key=lambda s: -s.confidence)
    if not good:
        raise _refusal(query, found, min_confidence)
    notes = [f"{s.camera}: {s.reason}" for s in good if s.reason]
    notes += _differences(query, good, yaw_symmetry_deg)
    notes += _doubts(good[0], [s for s in sightings if s.confidence < min_confidence])
    weights = np.array([s.confidence for s in good]) / sum(s.confidence for s in good)
    pose = ObjectPose(
        query.name,
        weights @ np.array([s.position_m for s in good]),
        _mean_rotation(good, weights, yaw_symmetry_deg),
        estimator,
        tuple(s.camera for s in good),
        float(weights @ [s.confidence for s in good]),
        "; ".join(notes),
    )
    return canonical_pose(pose, yaw_symmetry_deg)


def _refusal(
    query: ObjectQuery, found: Sequence[Sighting | Miss], min_confidence: float
) -> ObjectNotVisibleError | UncertainPoseError:
    # a camera that sees it comes before those that do not
    ordered = sorted(found, key=lambda item: isinstance(item, Miss))
    listed = "; ".join(f"{item.camera}: {_why_not(item)}" for item in ordered) or "there is no camera"
    if any(isinstance(item, Sighting) or item.seen for item in found):
        message = f"its pose is uncertain (least confidence {min_confidence:g}): {listed}"
        return UncertainPoseError(query.name, message, REMEDY)
    return ObjectNotVisibleError(query.name, f"no camera sees it: {listed}", REMEDY)


def _why_not(item: Sighting | Miss) -> str:
    if isinstance(item, Miss):
        return item.reason
    return f"confidence {item.confidence:.2f}, {item.reason or 'for no stated reason'}"


def _differences(query: ObjectQuery, good: Sequence[Sighting], yaw_symmetry_deg: float | None) -> list[str]:
    """Notes on cameras that put the object apart or turn it otherwise; more than is allowed is refused."""
    notes = []
    for one, other in combinations(good, 2):
        pair = f"cameras {one.camera} and {other.camera}"
        apart_cm = 100 * float(np.linalg.norm(one.position_m - other.position_m))
        turn_deg = _turn_deg(one, other, yaw_symmetry_deg)
        found = (
            (apart_cm, 100 * NOTED_DISTANCE_M, 100 * MAX_DISTANCE_M, f"put it {apart_cm:.1f} cm apart", "cm"),
            (turn_deg, NOTED_TURN_DEG, MAX_TURN_DEG, f"turn it {turn_deg:.0f} degrees apart", "degrees"),
        )
        for difference, noted, limit, words, unit in found:
            if difference > limit:
                remedy = f"at most {limit:g} {unit}: check both camera_to_world, and that images are not swapped"
                raise UncertainPoseError(query.name, f"{pair} {words}", remedy)
            if difference > noted:
                notes.append(f"{pair} {words}")
    return notes


def _doubts(best: Sighting, doubtful: Sequence[Sighting]) -> list[str]:
    """Notes on cameras that see it elsewhere, but not well enough to count."""
    return [
        f"{sighting.camera}, with confidence {sighting.confidence:.2f}, puts it {100 * apart_m:.0f} cm away"
        for sighting in doubtful
        if (apart_m := float(np.linalg.norm(best.position_m - sighting.position_m))) > MAX_DISTANCE_M
    ]


def _turn_deg(one: Sighting, other: Sighting, yaw_symmetry_deg: float | None) -> float:
    if one.quaternion_xyzw is None or other.quaternion_xyzw is None:
        return 0.0
    turn = _turn(Rotation.from_quat(one.quaternion_xyzw), other.quaternion_xyzw, yaw_symmetry_deg)
    return float(np.degrees(turn.magnitude()))


def _mean_rotation(good: Sequence[Sighting], weights: Array, yaw_symmetry_deg: float | None) -> Array | None:
    quaternions = [s.quaternion_xyzw for s in good if s.quaternion_xyzw is not None]
    if len(quaternions) < len(good):
        return None
    if len(quaternions) == 1:
        return quaternions[0]
    best = Rotation.from_quat(quaternions[0])
    turns = [Rotation.identity(), *(_turn(best, item, yaw_symmetry_deg) for item in quaternions[1:])]
    mean: Array = (best * Rotation.concatenate(turns).mean(weights)).as_quat(canonical=True)
    return mean


def _turn(one: Rotation, other_xyzw: Array, yaw_symmetry_deg: float | None) -> Rotation:
    """From one rotation to the other, as small as the symmetry allows."""
    turn = one.inv() * Rotation.from_quat(other_xyzw)
    return turn if yaw_symmetry_deg is None else canonical_rotation(turn, yaw_symmetry_deg)
