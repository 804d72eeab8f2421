"""The points of each object in the first image, for methods that want more of it than a pose."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery
from app.perception.cuboid.model import CuboidModel
from app.pipeline.geometry import backproject
from roboprompt_client.arrays import Array
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.trajectory import ObjectPose

ASSUMED_RADIUS_M = 0.025  # of an object of which nothing but its place is known
SPACING_M = 0.005
MAX_POINTS = 20_000  # that fill a box; a larger one has them farther apart
MIN_POINTS = 20  # of an object in images; with fewer, its pose says more
Source = Literal["images", "model", "assumed"]


def object_points(query: ObjectQuery, pose: ObjectPose, frames: Sequence[RgbdFrame]) -> tuple[Array, Source]:
    """(N, 3) points of the object in the world frame, m, and where they come from.

    `images`: its masked pixels that have depth, of every camera. `model`: a box of the size that the task's
    object model has, at the object's pose. `assumed`: a ball of 2.5 cm about its position.
    """
    seen = [
        backproject(frame, np.isin(frame.mask, query.mask_ids))
        for frame in frames
        if query.mask_ids and frame.mask is not None and frame.depth_m is not None
    ]
    if sum(map(len, seen)) >= MIN_POINTS:
        return np.concatenate(seen), "images"
    if isinstance(query.model, CuboidModel):
        middle_m = np.array(query.model.origin_m)
        return _placed(_box(np.array(query.model.size_m)) - middle_m, pose), "model"
    return _placed(_ball(ASSUMED_RADIUS_M), pose), "assumed"


def _box(size_m: Array) -> Array:
    """(N, 3) points that fill a box about the origin."""
    spacing_m = max(SPACING_M, float(np.cbrt(size_m.prod() / MAX_POINTS)))
    axes = [np.linspace(-side / 2, side / 2, max(2, int(side / spacing_m) + 1)) for side in size_m]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _ball(radius_m: float) -> Array:
    points = _box(np.full(3, 2 * radius_m))
    inside: Array = points[np.linalg.norm(points, axis=1) <= radius_m]
    return inside


def _placed(points_m: Array, pose: ObjectPose) -> Array:
    turn = Rotation.identity() if pose.quaternion_xyzw is None else Rotation.from_quat(pose.quaternion_xyzw)
    placed: Array = turn.apply(points_m) + pose.position_m
    return placed
