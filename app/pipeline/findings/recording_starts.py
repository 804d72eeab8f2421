"""Starts of recordings: on the way to an object or at it, so that nothing shows how the hand gets there."""

from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.findings import Finding, rules
from app.pipeline.findings.places import places_by_object, spread_m
from app.pipeline.findings.recording_ends import ENDS_SHARE, MIN_ENDS, MOVES_M_S, ONE_PLACE_M, Recorded
from app.pipeline.plans.rows import left_out_m
from app.pipeline.thresholds import WAY_SHARE

SPREAD_M = 0.10  # of starts that are not one place
EXPLAINED, MIN_LINEAR = 0.7, 6  # starts that depend on an object leave less of their scatter; of so many recordings


def begun_late_findings(pairs: Sequence[Recorded]) -> Iterator[Finding]:
    """Yield a finding where recordings begin on the way to an object or at it, and do not show how the hand gets there.

    Robots start in one place, or anywhere: where objects are does not explain it, unless one is in the hand. A person
    may have put the hand to one place at an object before recording: that is a warning.
    """
    starts_m = np.array([hand.start.position_m for _, hand in pairs])
    if len(pairs) < MIN_ENDS or spread_m(starts_m) < SPREAD_M:
        return
    near = np.linalg.norm(starts_m[:, None] - starts_m[None], axis=2) < ONE_PLACE_M
    home = near[near.sum(axis=1).argmax()]
    away = [pair for pair, at_home in zip(pairs, home, strict=True) if not at_home]
    if home.mean() > WAY_SHARE:
        number = len(away) if _most_move(away) or _in_one_place(away) else 0
        found, chosen = number > WAY_SHARE * len(pairs), False
    else:
        number, chosen = len(pairs), _in_one_place(pairs)
        found = not _most_hold(pairs) and (chosen or _on_the_way(pairs))
    if found:
        message = (
            f"{number} of {len(pairs)} recordings begin on the way to an object or at it, and do not show how the"
            " hand gets there. Begin to record where the robot starts, before it moves."
        )
        yield rules.BEGUN_LATE.finding(message, "demonstrations", value=float(not chosen))


def _in_one_place(pairs: Sequence[Recorded]) -> bool:
    """Return whether hands start at one place seen from an object."""
    starts_m = np.array([hand.start.position_m for _, hand in pairs])
    spreads_m = map(spread_m, places_by_object([shown for shown, _ in pairs], starts_m).values())
    return len(pairs) >= MIN_ENDS and min(spreads_m, default=np.inf) < min(ONE_PLACE_M, ENDS_SHARE * spread_m(starts_m))


def _on_the_way(pairs: Sequence[Recorded]) -> bool:
    """Return whether most hands move in the first moments, at places that are linear in those of an object."""
    if len(pairs) < MIN_LINEAR or not _most_move(pairs):
        return False
    starts_m = np.array([hand.start.position_m for _, hand in pairs])
    seen_m = places_by_object([shown for shown, _ in pairs], starts_m)
    usual_m = left_out_m(np.zeros((len(starts_m), 0)), starts_m)
    places_m = (starts_m - m for (_, axes), m in seen_m.items() if axes == "w")
    return any(left_out_m(place_m, starts_m) < EXPLAINED * usual_m for place_m in places_m)


def _most_move(pairs: Sequence[Recorded]) -> bool:
    """Return whether most hands move in the first moments."""
    return 2 * sum(hand.start_speed_m_s > MOVES_M_S for _, hand in pairs) > len(pairs)


def _most_hold(pairs: Sequence[Recorded]) -> bool:
    """Return whether most hands start closed, with an object in them."""
    return 2 * sum(not hand.starts_open and bool(hand.may_hold) for _, hand in pairs) > len(pairs)
