"""How often a recorded hand strokes to and fro: alignment may give a single and a double press the same rows."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from app.pipeline.plans.rows import WAY_SHARE
from roboprompt_client.types.arrays import Array

# (segment length in m, cosine of the angle between successive segments): long segments that turn back sharply are
# certainly a reversal, and anything that turns back less is possibly one.
CERTAIN, POSSIBLE = (0.04, -0.8), (0.015, -0.3)


class Reversals(NamedTuple):
    """How often a hand reverses its direction of motion: at least `certain` times, at most `possible` times."""

    certain: int
    possible: int

    @classmethod
    def of(cls, positions_m: Array) -> "Reversals":
        """Count them in a path (T, 3)."""
        return cls(*(_count(positions_m, *limits) for limits in (CERTAIN, POSSIBLE)))


def _count(positions_m: Array, segment_m: float, cosine: float) -> int:
    """Count the corners sharper than `cosine` in the path, resampled to steps of at least `segment_m`."""
    kept = [0]
    while (far := np.linalg.norm(positions_m[kept[-1] :] - positions_m[kept[-1]], axis=1) >= segment_m).any():
        kept.append(kept[-1] + int(far.argmax()))
    segments_m = np.diff(positions_m[kept], axis=0)
    directions = segments_m / np.linalg.norm(segments_m, axis=1, keepdims=True)
    return int(((directions[1:] * directions[:-1]).sum(axis=1) < cosine).sum())


def more_strokes(reversals: Sequence[Reversals]) -> Array | None:
    """Return (N,) bool: which recordings make more strokes, if more than a third do and more than a third do not.

    A stroke more is two reversals more; one more may come from where the hand starts. None where all make about equally
    many, or some cannot be assigned to either.
    """
    certain, possible = np.array(reversals).reshape(-1, 2).T
    splits = [(certain >= number, possible <= number - 2) for number in np.unique(certain)]
    clear = (more for more, fewer in splits if (more | fewer).all() and min(more.mean(), fewer.mean()) > WAY_SHARE)
    return next(clear, None)
