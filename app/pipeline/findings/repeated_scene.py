"""Observations that repeat a demonstration's exactly: old ones, as no pose is measured twice alike."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.places import FIXED_M, ShownPlaces
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

REPEATED_M = 1e-5  # two measurements of one pose differ by more


def repeated_scene(
    observed: Sequence[ObjectPose],
    places: Sequence[ShownPlaces],
    shown: Sequence[Demonstration],
    followed: frozenset[str],
) -> Finding | None:
    """Return a finding if objects are exactly where one demonstration had them, as no two measurements are.

    All of them, or one that the motion follows and that demonstrations never have twice in one place. Objects that
    never move do not count, nor do positions in whole millimeters, which people write by hand.
    """
    moved = [pose for pose, place in zip(observed, places, strict=True) if place.box_m.width.max() > FIXED_M]
    if not moved or all(map(_in_millimeters, moved)):
        return None
    by_name_m = {pose.name: np.array([old.object(pose.name).position_m for old in shown]) for pose in moved}
    repeats = {pose.name: _repeats(pose.position_m, by_name_m[pose.name]) for pose in moved}
    stale = np.logical_and.reduce(list(repeats.values()))
    if stale.any():
        what, where = "All objects are", "objects"
    else:
        one = next((pose for pose in moved if pose.name in followed and _stale(pose, by_name_m[pose.name])), None)
        if one is None:
            return None
        what, where, stale = f"{one.name} is", f"objects[{one.name}]", repeats[one.name]
    message = (
        f"{what} exactly (to 0.01 mm) where demonstration {shown[int(stale.argmax())].id} had"
        f" {'them' if where == 'objects' else 'it'}; no camera measures that twice. This is probably an old"
        " observation: observe the scene again."
    )
    return rules.SCENE_OF_A_DEMONSTRATION.finding(message, where)


def _stale(pose: ObjectPose, places_m: Array) -> bool:
    """Return whether an object is where one of its places (N, 3) was, which are all different."""
    if _in_millimeters(pose) or not _repeats(pose.position_m, places_m).any():
        return False
    return all(not _repeats(place_m, places_m[:k]).any() for k, place_m in enumerate(places_m))


def _repeats(place_m: Array, places_m: Array) -> npt.NDArray[np.bool_]:
    """Return (N,) bool: which of the places (N, 3) are the same measurement as a place (3,)."""
    repeats: npt.NDArray[np.bool_] = np.abs(places_m - place_m).max(axis=1) < REPEATED_M
    return repeats


def _in_millimeters(pose: ObjectPose) -> bool:
    return bool(np.abs(pose.position_m - pose.position_m.round(3)).max() < REPEATED_M)
