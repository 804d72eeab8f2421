"""Pose estimators by name, and which of them finds an object."""

from collections.abc import Sequence

from app.perception.base import GivenPoses, ObjectQuery, PoseEstimator
from app.perception.cuboid.estimator import CuboidPoses
from app.perception.markers.estimator import MarkerPoses
from app.perception.masks import MaskedPoints
from app.perception.registered.estimator import RegisteredPoses
from app.perception.remote import RemotePoses
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose

ESTIMATORS: dict[str, PoseEstimator] = {
    "given": GivenPoses(),
    "masks": MaskedPoints(),
    "cuboid": CuboidPoses(),
    "markers": MarkerPoses(),
    "registered": RegisteredPoses(),
    "remote": RemotePoses(),
}


def estimate_poses(
    default: str, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame], *, given_first: bool = False
) -> tuple[ObjectPose, ...]:
    """One pose per object, in the given order: found by its model's estimator, without a model by that named `default`.

    Args:
        given_first: a position that the caller gives is used whatever would find the object.

    Raises:
        as PoseEstimator.estimate.
    """
    groups: dict[str, list[ObjectQuery]] = {}
    for query in objects:
        name = default if query.model is None else query.model.estimator
        groups.setdefault("given" if given_first and query.position_m is not None else name, []).append(query)
    found = {pose.name: pose for name, group in groups.items() for pose in ESTIMATORS[name].estimate(group, frames)}
    return tuple(found[query.name] for query in objects)
