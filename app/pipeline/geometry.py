"""Points, rigid transforms as (4, 4) matrices, and canonical poses of symmetric objects."""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose


def backproject(frame: RgbdFrame, pixels: np.ndarray) -> Array:
    """The world points (N, 3) in meters of those `pixels` (H, W) bool whose depth is known.

    Raises:
        InvalidInputError: if the frame has no depth image.
    """
    if frame.depth_m is None:
        raise InvalidInputError(f"depth_{frame.camera.name}", "is missing", "a depth image beside the mask")
    rows, columns = np.nonzero(pixels & (frame.depth_m > 0))
    return frame.camera.deproject(rows, columns, frame.depth_m[rows, columns])


def transform_points(source_to_target: Array, points: Array) -> Array:
    """Points (N, 3) taken from the source frame to the target frame by a (4, 4) rigid transform."""
    moved: Array = points @ source_to_target[:3, :3].T + source_to_target[:3, 3]
    return moved


def canonical_pose(pose: ObjectPose, yaw_symmetry_deg: float | None, toward_rad: float = 0.0) -> ObjectPose:
    """The same pose with the object turned about its own z axis to the representative nearest a yaw.

    Equal scenes then give equal text, whichever of its equal sides an estimator called the front.

    Args:
        yaw_symmetry_deg: the turn that leaves the object unchanged (cube 90, cuboid 180); 0 where every turn does (a
            round object); None where none does.
        toward_rad: that yaw.
    """
    if pose.quaternion_xyzw is None or yaw_symmetry_deg is None:
        return pose
    turned = canonical_rotation(Rotation.from_quat(pose.quaternion_xyzw), yaw_symmetry_deg, toward_rad)
    return replace(pose, quaternion_xyzw=turned.as_quat(canonical=True))


def canonical_rotation(rotation: Rotation, yaw_symmetry_deg: float, toward_rad: float = 0.0) -> Rotation:
    """The same of a rotation, see `canonical_pose`."""
    (xx, xy, _), (yx, yy, _), _ = rotation.as_matrix()
    if yaw_symmetry_deg == 0:
        turns_rad = math.atan2(-yx, yy) + np.array([0, np.pi])  # these bring the x axis above the world's
    else:
        turns_rad = np.radians(np.arange(0, 360, yaw_symmetry_deg))
    cos, sin = np.cos(turns_rad), np.sin(turns_rad)
    yaws_rad = np.arctan2(yx * cos + yy * sin, xx * cos + xy * sin)
    away_rad = np.abs((yaws_rad - toward_rad + math.pi) % (2 * math.pi) - math.pi)
    nearest = np.lexsort((yaws_rad, away_rad.round(6)))[0]  # of -45 and 45 degrees of a cube always the same
    return rotation * Rotation.from_euler("z", turns_rad[nearest])


def rigid(position_m: npt.ArrayLike, quaternion_xyzw: npt.ArrayLike) -> Array:
    """The (4, 4) transform from a frame with this pose to the frame in which the pose is given."""
    transform: Array = np.eye(4)
    transform[:3, :3] = Rotation.from_quat(quaternion_xyzw).as_matrix()
    transform[:3, 3] = position_m
    return transform


def inverse_transform(transform: Array) -> Array:
    """The inverse of a (4, 4) rigid transform."""
    back: Array = np.eye(4)
    back[:3, :3] = transform[:3, :3].T
    back[:3, 3] = -transform[:3, :3].T @ transform[:3, 3]
    return back
