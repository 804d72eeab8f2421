"""Scatter of demonstrated rows relative to candidate anchors, and the test by which one of them explains a row.

A row follows the anchor relative to which it is the same in all demonstrations. Every choice of an anchor therefore
compares residuals: how far the row's poses scatter, seen from each candidate. Where two candidates are compared for
what only one of them can explain, the smaller scatter must be small beyond chance (an F test).
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import betaincinv

from app.pipeline.episode import Demonstration
from app.pipeline.representation.anchors import OBJECT_FRAMES, AnchorPose, Anchors, anchor_poses, hand_poses, in_frame
from app.pipeline.thresholds import M_PER_RAD, TURNED_M
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array

MIN_SCATTERED = 3  # demonstrations that show what a row follows by their scatter
SIGNIFICANCE = 0.01  # significance level of the F test
MANY_TURNED = 8  # from this number of demonstrations on, the farthest are left out as outliers:
KEPT_SHARE = 0.8  # this share is kept; of fewer, the one unlike the others may decide
TURNED_SHARE = 0.6  # largest share of a scatter that the right anchor leaves; less for few demonstrations
CONTRADICTED_M = 0.01  # least scatter (rms) of a place that something else must explain, and largest between objects
SERVES_M = 0.02  # largest scatter relative to the right anchor: rows on the way that scatter more have none
MIN_FOR_QUANTILE = 5  # from this number on a quantile replaces the maximum, so that one outlier does not decide
QUANTILE = 0.8  # that quantile
AROUND_M = 0.06  # horizontal distance from a place within which the hand comes and goes
# Of a single demonstration: a hand that is aligned with an object's axes acts at it rather than at a nearer object
SQUARE = Rotation.create_group("O")  # the 24 rotations that take axes to axes
MAX_OBLIQUE_RAD = math.radians(20)  # beyond this angle it is not aligned
OBLIQUE_M_PER_RAD = 0.3 / MAX_OBLIQUE_RAD  # a hand that is not aligned counts as 30 cm farther


def certain_share(number: int, dimensions: int) -> float:
    """Return the share of a scatter that is small beyond chance.

    Of two equal scatters of offsets in 1 or 2 dimensions one is as small once in a hundred times (an F test of their
    variances about the most central demonstration): in a plane 0.1 of the other for three demonstrations, 0.34 for
    five, 0.49 for ten.

    Args:
        number: of demonstrations, `MIN_SCATTERED` or more.
    """
    half_freedom = dimensions * (_num_kept(number) - 2) / 2
    quantile = float(betaincinv(half_freedom, half_freedom, SIGNIFICANCE))
    return min(TURNED_SHARE, math.sqrt(quantile / (1 - quantile)))


def much_less(off_m: Array, than_m: Array, share: float | Array) -> np.ndarray:
    """Return (...) bool: whether `than_m` counts, and `off_m` is smaller than this share of it and than `SERVES_M`."""
    return np.asarray((than_m >= TURNED_M) & (off_m < share * than_m) & (off_m < SERVES_M))


def scatters_m(group: Sequence[Demonstration], anchors: Anchors) -> tuple[Array, Array]:
    """Return the scatter of the hand relative to objects along the world's axes, and along the objects' own.

    Returns:
        Each (2, K) in meters: of positions, and of rotations (by `M_PER_RAD`).
    """
    world_m, own_m = (poses_scatter_m(group, in_frame(anchors, frame)) for frame in OBJECT_FRAMES)
    return world_m, own_m


def poses_scatter_m(group: Sequence[Demonstration], anchors: Anchors) -> Array:
    """Return the scatter (2, K) of positions and rotations relative to the anchors: rms from the most central one.

    Heights do not count at upright objects, since a yaw does not change them.
    """
    offsets_m, hands = _relative(group, anchors)
    if not any(anchor.at_tilted for anchor in anchors):
        offsets_m = offsets_m[..., :2]
    places_m = np.linalg.norm(offsets_m[:, None] - offsets_m[None], axis=3)
    turns_m = M_PER_RAD * quaternions.angles_rad(hands[:, None], hands)
    return central_scatter_m(np.array([places_m, turns_m]))


def central_scatter_m(apart_m: Array) -> Array:
    """Return the scatter (..., K) of poses that are so far apart (..., N, N, K): rms from the most central one."""
    scatter_m: Array = _rms(apart_m, axis=-2).min(axis=-2)
    return scatter_m


def axes_scatter_m(group: Sequence[Demonstration], anchors: Anchors) -> Array:
    """Return the scatter (K, 3) of places relative to the anchors; of axes that turn with an object the larger one."""
    scatter_m = offsets_scatter_m(_relative(group, anchors)[0])
    if anchors[0].place_turns:
        scatter_m[:, :2] = scatter_m[:, :2].max(axis=1, keepdims=True)
    return scatter_m


def offsets_scatter_m(offsets_m: Array) -> Array:
    """Return the scatter (...) of offsets (N, ...) along each axis: rms from the median."""
    return _rms(np.abs(offsets_m - np.median(offsets_m, axis=0)), axis=0)


def farthest_m(group: Sequence[Demonstration], anchors: Anchors) -> list[float]:
    """Return of each action how far the demonstrations are from their center; rotations count by `M_PER_RAD`.

    The farthest one counts, of many demonstrations the quantile `QUANTILE`. A single demonstration has its
    distance from the anchor instead, and more where the hand is not aligned with the anchor's axes.
    """
    offsets_m, hands = _relative(group, anchors)
    if len(group) == 1:
        alone: list[float] = (np.linalg.norm(offsets_m[0], axis=1) + _oblique_m(Rotation.from_quat(hands[0]))).tolist()
        return alone
    off_m = np.abs(offsets_m - np.median(offsets_m, axis=0)).max(axis=2)
    rotations = Rotation.from_quat(hands)
    off_m += M_PER_RAD * (rotations.mean(axis=0).inv() * rotations).magnitude()
    many = len(group) >= MIN_FOR_QUANTILE
    farthest: list[float] = (np.quantile(off_m, QUANTILE, axis=0) if many else off_m.max(axis=0)).tolist()
    return farthest


def hands_at(group: Sequence[Demonstration]) -> Array:
    """Return the hand's positions (N, K, 3) in the world frame, in meters."""
    return np.array([[action.position_m for action in demonstration.actions] for demonstration in group])


def around(hands_m: Array, k: int) -> list[bool]:
    """Return for each row whether the hand is there near its place in row `k`, in all demonstrations (N, K, 3)."""
    aside_m = np.linalg.norm((hands_m - hands_m[:, k : k + 1])[..., :2], axis=2).max(axis=0)
    near: list[bool] = (aside_m <= AROUND_M).tolist()
    return near


def _relative(group: Sequence[Demonstration], anchors: Anchors) -> tuple[Array, Array]:
    """Return every action relative to the anchors: offsets (N, K, 3) in meters, and rotations (N, K, 4)."""
    number = len(group[0].actions)
    poses_m, hands = hand_poses([action for demonstration in group for action in demonstration.actions])
    each = AnchorPose(*(np.repeat(of_all, number, axis=0) for of_all in anchor_poses(anchors, group)))
    offsets_m, rotations = each.seen(poses_m, hands)
    return offsets_m.reshape(-1, number, 3), rotations.as_quat().reshape(-1, number, 4)


def _rms(off: Array, axis: int) -> Array:
    """Return the root mean square along an axis of N demonstrations; of many without the farthest fifth."""
    kept = np.sort(off, axis=axis).take(range(_num_kept(off.shape[axis])), axis=axis)
    rms: Array = np.sqrt((kept**2).mean(axis=axis))
    return rms


def _num_kept(number: int) -> int:
    return math.ceil(KEPT_SHARE * number) if number >= MANY_TURNED else number


def _oblique_m(hands: Rotation) -> Array:
    """Return the misalignment (K,) of hands with the axes that they are relative to, in meters."""
    off_rad = np.min([(turn.inv() * hands).magnitude() for turn in SQUARE], axis=0)
    oblique: Array = OBLIQUE_M_PER_RAD * np.minimum(off_rad, MAX_OBLIQUE_RAD)
    return oblique
