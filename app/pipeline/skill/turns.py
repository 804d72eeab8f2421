"""Rotations as unit quaternions (..., 4) in the order x y z w, many at once: all functions broadcast.

Vectors of the tangent space are rotation vectors (..., 3) in radians, as in Calinon's "Gaussians on Riemannian
manifolds" (IEEE RAM 2020): a residual between rotations is the logarithm of their quotient.
"""

import numpy as np
import numpy.typing as npt

from roboprompt_client.types.arrays import Array

IDENTITY: Array = np.array([0.0, 0.0, 0.0, 1.0])
UP: Array = np.array([0.0, 0.0, 1.0])
HALF_TURN: Array = np.array([0.0, 0.0, 1.0, 0.0])
ROUNDING_DIGITS = 6  # sums of radians that differ by less are the same
MEDOID_CAP_RAD = 1.0  # a rotation farther off is elsewhere: how far does not matter to the medoid (Huber's idea)
SMALL = 1e-9  # sines below it have lost their axis


def product(after: npt.ArrayLike, first: npt.ArrayLike) -> Array:
    """Return the rotations `first` followed by `after`; the order is that of a matrix product."""
    a, b, c, d = np.moveaxis(np.asarray(after, float), -1, 0)
    x, y, z, w = np.moveaxis(np.asarray(first, float), -1, 0)
    return np.stack(
        [
            d * x + a * w + b * z - c * y,
            d * y - a * z + b * w + c * x,
            d * z + a * y - b * x + c * w,
            d * w - a * x - b * y - c * z,
        ],
        axis=-1,
    )


def inverse(turn: npt.ArrayLike) -> Array:
    """Return the inverse rotations."""
    return np.asarray(turn, float) * (-1.0, -1.0, -1.0, 1.0)


def rotated(turn: npt.ArrayLike, vector: npt.ArrayLike) -> Array:
    """Return vectors (..., 3) rotated."""
    x, y, z, w = np.moveaxis(np.asarray(turn, float), -1, 0)
    a, b, c = np.moveaxis(np.asarray(vector, float), -1, 0)
    i, j, k = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return np.stack([a + w * i + y * k - z * j, b + w * j + z * i - x * k, c + w * k + x * j - y * i], axis=-1)


def log(turn: npt.ArrayLike) -> Array:
    """Return the rotation vectors (..., 3), of lengths up to pi."""
    q = np.asarray(turn, float)
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., 3:])
    vector: Array = q[..., :3] * np.where(sine < SMALL, 2.0, angle / np.maximum(sine, SMALL))
    return vector


def exp(vector: npt.ArrayLike) -> Array:
    """Return the rotations of rotation vectors (..., 3)."""
    v = np.asarray(vector, float)
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([v * np.sinc(angle / (2 * np.pi)) / 2, np.cos(angle / 2)], axis=-1)


def about_z(angle_rad: npt.ArrayLike) -> Array:
    """Return the rotations about the vertical."""
    half = np.asarray(angle_rad, float) / 2
    zero = np.zeros_like(half)
    return np.stack([zero, zero, np.sin(half), np.cos(half)], axis=-1)


def yaw(turn: npt.ArrayLike) -> Array:
    """Return the angles (...) of the rotated x axes in the horizontal plane."""
    x, y, z, w = np.moveaxis(np.asarray(turn, float), -1, 0)
    angle: Array = np.arctan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))
    return angle


def angle(one: npt.ArrayLike, other: npt.ArrayLike) -> Array:
    """Return the angles (...) between rotations, 0 to pi."""
    alike = np.abs((np.asarray(one, float) * np.asarray(other, float)).sum(-1))
    found: Array = 2 * np.arccos(np.minimum(alike, 1))
    return found


def canonical(turn: Array) -> Array:
    """Return of each two quaternions (..., 4) of one rotation the one with w >= 0."""
    return np.where(turn[..., 3:] < 0, -turn, turn)


def first_least(values: npt.ArrayLike) -> npt.NDArray[np.intp]:
    """Return where values (..., N) are least: the first of those that only rounding tells apart."""
    found: npt.NDArray[np.intp] = np.asarray(values).round(ROUNDING_DIGITS).argmin(-1)
    return found


def medoid(turns: Array) -> Array:
    """Return of rotations (..., N, 4) the one (..., 4) that is nearest to the others."""
    apart = np.minimum(angle(turns[..., :, None, :], turns[..., None, :, :]), MEDOID_CAP_RAD).sum(-1)
    found: Array = np.take_along_axis(turns, first_least(apart)[..., None, None], axis=-2)[..., 0, :]
    return found


def wrapped(angle_rad: npt.ArrayLike) -> Array:
    """Return angles in -pi..pi."""
    found: Array = (np.asarray(angle_rad, float) + np.pi) % (2 * np.pi) - np.pi
    return found
