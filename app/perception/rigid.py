"""Rigid transforms as (4, 4) matrices."""

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.pipeline.arrays import Array


def rigid(position_m: npt.ArrayLike, quaternion_xyzw: npt.ArrayLike) -> Array:
    """From a frame with this pose to the frame in which the pose is given."""
    transform: Array = np.eye(4)
    transform[:3, :3] = Rotation.from_quat(quaternion_xyzw).as_matrix()
    transform[:3, 3] = position_m
    return transform


def inverse(transform: Array) -> Array:
    """The way back."""
    back: Array = np.eye(4)
    back[:3, :3] = transform[:3, :3].T
    back[:3, 3] = -transform[:3, :3].T @ transform[:3, 3]
    return back
