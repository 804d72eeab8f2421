"""Whether the hand's place and its rotation turn with an object alike, or only one of them does."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import betaincinv

from app.pipeline.episode import Demonstration
from app.pipeline.representation.anchors import (
    M_PER_RAD,
    MIXED_FRAMES,
    OBJECT_FRAMES,
    Anchors,
    in_frame,
    relative_poses,
)
from roboprompt_client.arrays import Array

MANY_TURNED = 8  # demonstrations, from which on those that are farthest off do not decide, but
DECIDING_SHARE = 0.8  # this share of them: of fewer one that is turned as no other may say most
MIN_TURNED = 3  # demonstrations that show what turns with an object
TURNED_M = 0.006  # scatter (rms) along the wrong axes that matters; of rotations 6 degrees
TURNED_SHARE = 0.6  # of it, at most, is left along the right axes, and of few as little as noise leaves by `CHANCE`;
SERVES_M = 0.02  # and no more than this: rows on the way that scatter about everything have no axes
CHANCE = 0.01


def mixed_frames(group: Sequence[Demonstration], own: Anchors, tilted: frozenset[str]) -> dict[Anchors, list[int]]:
    """The rows in which only place or only rotation of the hand turns with an object, by the frame that says so.

    Three demonstrations or more must contradict both frames of the object, one by the place and the other by the hand's
    rotation: either scatters by `TURNED_M` along the wrong axes, and along the right ones by so small a share of it
    that of independent scatters one would be as small once in a hundred times (an F test of the variances of offsets in
    a plane from a demonstration among them: 0.1 of three demonstrations, 0.34 of five, 0.49 of ten). Noise is the same
    along both axes, so that it passes far less often.

    Args:
        own: the objects' own frames.
    """
    if len(group) < MIN_TURNED or not group[0].actions:
        return {}
    freedom = _deciding(len(group)) - 2  # half of that of offsets in a plane
    quantile = float(betaincinv(freedom, freedom, CHANCE))
    certain = min(TURNED_SHARE, math.sqrt(quantile / (1 - quantile)))
    world_m, own_m = scatters_m(group, own, tilted)
    by_world, by_own = much_less(world_m, own_m, certain), much_less(own_m, world_m, certain)
    rows = np.stack([by_own[0] & by_world[1], by_world[0] & by_own[1]])
    found = zip(MIXED_FRAMES, rows, strict=True)
    return {in_frame(own, frame): np.flatnonzero(which).tolist() for frame, which in found if which.any()}


def scatters_m(group: Sequence[Demonstration], anchors: Anchors, tilted: frozenset[str]) -> tuple[Array, Array]:
    """How far the hand scatters along the world's axes at some objects, and along the objects' own.

    Returns:
        Of each (2, K) in metres: the hand's places, and its rotations weighed as elsewhere.
    """
    world_m, own_m = (_scatter_m(group, in_frame(anchors, frame), tilted) for frame in OBJECT_FRAMES)
    return world_m, own_m


def much_less(off_m: Array, than_m: Array, share: float | Array) -> np.ndarray:
    """(...) bool: whether a scatter is so small a share of one that matters."""
    return np.asarray((than_m >= TURNED_M) & (off_m < share * than_m) & (off_m < SERVES_M))


def _scatter_m(group: Sequence[Demonstration], anchors: Anchors, tilted: frozenset[str]) -> Array:
    """(2, K) how far places and rotations scatter relative to the anchors.

    It is the rms distance from the most central demonstration; of many, without the fifth that is farthest from it.
    An upright object turns no heights: these do not count.
    """
    relative = [relative_poses(d, anchor, tilted) for d, anchor in zip(group, anchors, strict=True)]
    offsets_m = np.array([offsets for offsets, _ in relative])  # (N, K, 3)
    if tilted.isdisjoint(anchor.object_name for anchor in anchors):
        offsets_m = offsets_m[..., :2]
    quaternions = np.array([rotations.as_quat() for _, rotations in relative])  # (N, K, 4)
    cosines = np.abs(np.einsum("ikq,jkq->ijk", quaternions, quaternions))
    places_m = np.linalg.norm(offsets_m[:, None] - offsets_m[None], axis=3)
    apart_m = np.sort(np.array([places_m, 2 * M_PER_RAD * np.arccos(np.minimum(cosines, 1))]), axis=2)
    scatter: Array = np.sqrt((apart_m[:, :, : _deciding(len(group))] ** 2).mean(axis=2)).min(axis=1)
    return scatter


def _deciding(number: int) -> int:
    """Of so many demonstrations those that decide."""
    return math.ceil(DECIDING_SHARE * number) if number >= MANY_TURNED else number
