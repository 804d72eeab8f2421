"""Pose estimators by name."""

from app.perception.base import PoseEstimator
from app.perception.cuboid import CuboidPoses
from app.perception.given import GivenPoses
from app.perception.markers import MarkerPoses
from app.perception.masks import MaskedPoints
from app.perception.remote import RemotePoses
from app.pipeline.errors import InvalidInputError

ESTIMATORS: dict[str, PoseEstimator] = {
    "given": GivenPoses(),
    "masks": MaskedPoints(),
    "cuboid": CuboidPoses(),
    "markers": MarkerPoses(),
    "remote": RemotePoses(),
}


def pose_estimator(name: str) -> PoseEstimator:
    """The estimator of that name.

    Raises:
        InvalidInputError: for an unknown name; lists those there are.
    """
    if name not in ESTIMATORS:
        raise InvalidInputError("pose_estimator", f"is {name!r}", ", ".join(ESTIMATORS))
    return ESTIMATORS[name]
