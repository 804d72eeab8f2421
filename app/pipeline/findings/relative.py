"""Places relative to objects, over several scenes: what is constant relative to an object belongs to it."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Query
from roboprompt_client.types.arrays import Array

SPREAD_SHARE = 0.8  # of the places, which a spread counts; the others may be outliers


def places_by_object(scenes: Sequence[Query], places_m: Array) -> dict[tuple[str, str], Array]:
    """Return places (N, 3) of N scenes relative to each object that all have, by its role and the axes.

    The role is its name, or its place in the instruction, as `<0>`. Axes are the world's (`w`), or the object's own
    (`o`) where all its rotations are known.
    """
    by_role = [{scene.order.placeholder(pose.name): pose for pose in scene.objects} for scene in scenes]
    found: dict[tuple[str, str], Array] = {}
    for role in by_role[0]:
        poses = [scene[role] for scene in by_role if role in scene]
        if len(poses) < len(scenes):
            continue
        found[role, "w"] = places_m - np.array([pose.position_m for pose in poses])
        turned = [pose.quaternion_xyzw for pose in poses if pose.quaternion_xyzw is not None]
        if len(turned) == len(scenes):
            found[role, "o"] = Rotation.from_quat(np.array(turned)).inv().apply(found[role, "w"])
    return found


def spread_m(places_m: Array) -> float:
    """Return the distance from their median within which most of the places (N, 3) lie."""
    return float(np.quantile(np.linalg.norm(places_m - np.median(places_m, axis=0), axis=1), SPREAD_SHARE))
