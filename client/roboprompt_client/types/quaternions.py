"""Rotations as unit quaternions (4,) in the order x y z w: what the robot's side and the service need of them."""

import math

import numpy as np
import numpy.typing as npt

from roboprompt_client.types.arrays import Array

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
EXACTLY = 1e-9
SMALL_RAD = 1e-8  # below it a rotation's axis is lost in rounding, and sin(x) is x


def product(after: npt.ArrayLike, first: npt.ArrayLike) -> Array:
    """Return the rotation `first` followed by `after`; the order is that of a matrix product."""
    (a, b, c, d), (x, y, z, w) = np.asarray(after, float).tolist(), np.asarray(first, float).tolist()
    return np.array(
        [
            d * x + a * w + b * z - c * y,
            d * y - a * z + b * w + c * x,
            d * z + a * y - b * x + c * w,
            d * w - a * x - b * y - c * z,
        ]
    )


def inverse(rotation: npt.ArrayLike) -> Array:
    """Return the inverse rotation."""
    return np.asarray(rotation, float) * (-1.0, -1.0, -1.0, 1.0)


def rotated(rotation: npt.ArrayLike, vector: npt.ArrayLike) -> Array:
    """Return a vector (3,) rotated."""
    x, y, z, w = np.asarray(rotation, float).tolist()
    a, b, c = np.asarray(vector, float).tolist()
    # twice the cross product of the quaternion's vector part and `vector`; for so few numbers floats beat arrays
    i, j, k = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return np.array([a + w * i + y * k - z * j, b + w * j + z * i - x * k, c + w * k + x * j - y * i])


def canonical(rotation: npt.ArrayLike) -> Array:
    """Return q or -q, which are the same rotation: the one whose first non-zero number of w, x, y, z is positive."""
    q = np.asarray(rotation, float)
    w, x, y, z = q[3], *q[:3]
    leading = next((part for part in (w, x, y, z) if part != 0), 1.0)
    return -q if leading < 0 else q


def angle_rad(rotation: npt.ArrayLike) -> float:
    """Return the rotation's angle, 0 to pi."""
    q = np.asarray(rotation, float)
    return 2.0 * math.atan2(float(np.linalg.norm(q[:3])), abs(float(q[3])))


def is_identity(rotations: npt.ArrayLike) -> bool:
    """Return whether rotations (..., 4) are exactly the identity: no measured one is as near to it."""
    return bool(np.abs(np.asarray(rotations, float)[..., :3]).max() < EXACTLY)


def angle_between_rad(first: npt.ArrayLike, second: npt.ArrayLike) -> float:
    """Return the angle between two rotations, 0 to pi."""
    return angle_rad(product(inverse(first), second))


def angles_rad(first: Array, second: Array) -> Array:
    """Return the angles (...) between rotations (..., 4) that broadcast, each 0 to pi."""
    alike = np.abs(np.einsum("...q,...q->...", first, second))
    angles: Array = 2 * np.arccos(np.minimum(alike, 1))
    return angles


def about_z(angle_rad: float) -> Array:
    """Return the rotation about the z axis."""
    return np.array([0.0, 0.0, math.sin(angle_rad / 2), math.cos(angle_rad / 2)])


def yaw_rad(rotation: npt.ArrayLike) -> float:
    """Return the angle of the rotated x axis in the horizontal plane."""
    x_axis = rotated(rotation, (1.0, 0.0, 0.0))
    return math.atan2(x_axis[1], x_axis[0])


def tilt_rad(rotation: npt.ArrayLike) -> float:
    """Return the angle between the rotated z axis and the vertical."""
    return math.acos(min(1.0, max(-1.0, float(rotated(rotation, (0.0, 0.0, 1.0))[2]))))


def from_rotation_vector(vector_rad: npt.ArrayLike) -> Array:
    """Return the rotation of a rotation vector (3,): its direction is the axis, its length the angle (UR)."""
    vector = np.asarray(vector_rad, float)
    angle = float(np.linalg.norm(vector))
    per_length = 0.5 if angle < SMALL_RAD else math.sin(angle / 2) / angle
    return np.array([*(per_length * vector), math.cos(angle / 2)])


def to_rotation_vector(rotation: npt.ArrayLike) -> Array:
    """Return the rotation vector (3,), of a length up to pi."""
    q = np.asarray(rotation, float)
    q = -q if q[3] < 0 else q
    angle, sine = angle_rad(q), float(np.linalg.norm(q[:3]))
    vector: Array = q[:3] * (2.0 if sine < SMALL_RAD else angle / sine)
    return vector


def to_matrix(rotation: npt.ArrayLike) -> Array:
    """Return the rotation matrix (3, 3)."""
    return np.stack([rotated(rotation, axis) for axis in np.eye(3)], axis=1)


def from_matrix(matrix: npt.ArrayLike) -> Array:
    """Return the quaternion of a rotation matrix (3, 3): the eigenvector of the largest eigenvalue of Bar-Itzhack's K.

    Bar-Itzhack, "New method for extracting the quaternion from a rotation matrix", J. Guidance 2000.
    """
    m = np.asarray(matrix, float)
    k = np.empty((4, 4))
    k[3, 3] = np.trace(m)
    k[:3, :3] = m + m.T - k[3, 3] * np.eye(3)
    k[3, :3] = k[:3, 3] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    return canonical(np.linalg.eigh(k)[1][:, -1])
