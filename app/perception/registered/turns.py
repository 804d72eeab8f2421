"""Other yaws that fit a view as well as the best one, and the symmetry of an object for which they are the same."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from app.perception.registered.hypotheses import Hypothesis
from app.perception.registered.icp import angle_deg

SAME_YAW_DEG = 14.0
RIVAL_SUPPORT = 0.12  # least share of an object's visible side that a rival explains
SYMMETRIES_DEG = (180.0, 120.0, 90.0)  # that other yaws may suggest, the least symmetric first
ALL_AROUND = 4  # so many other yaws suggest a round object


def yaw_rivals(found: Sequence[Hypothesis], symmetry_deg: float | None) -> list[Hypothesis]:
    """Return the poses of other yaws that the evidence does not distinguish from the first."""
    best = found[0]
    if symmetry_deg == 0:
        return []
    return [
        other
        for other in found[1:]
        if angle_deg(best.rotation, other.rotation, symmetry_deg) > SAME_YAW_DEG
        and other.support > RIVAL_SUPPORT
        and not best.beats(other)
    ]


def turns_deg(best: Hypothesis, rivals: Sequence[Hypothesis], symmetry_deg: float | None) -> tuple[float, ...]:
    """Return by how much the rivals are turned from the best pose, ascending; rivals of nearly one yaw count once."""
    turns = np.sort([(rival.yaw_deg - best.yaw_deg) % (symmetry_deg or 360.0) for rival in rivals])
    starts = [0, *(number for number, (one, other) in enumerate(pairwise(turns), 1) if other - one > SAME_YAW_DEG)]
    return tuple(float(np.median(turns[start:end])) for start, end in pairwise([*starts, len(turns)]) if end > start)


def suggested_symmetry(turns: Sequence[float]) -> str | float | None:
    """Return the value of `symmetric` under which such turns (degrees) change nothing; None if none is likely."""
    for symmetry_deg in SYMMETRIES_DEG:
        if all(abs(turn - symmetry_deg * round(turn / symmetry_deg)) < SAME_YAW_DEG for turn in turns):
            return symmetry_deg
    return "yaw" if len(turns) >= ALL_AROUND else None


def in_words(turns: Sequence[float]) -> str:
    """Return e.g. ``turned by 90, 180 and 270 degrees``."""
    *most, last = (f"{turn:.0f}" for turn in turns)
    return f"turned by {', '.join(most)} and {last} degrees" if most else f"turned by {last} degrees"
