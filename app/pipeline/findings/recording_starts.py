"""Starts of recordings: on the way to an object or at it, so that nothing shows how the hand gets there."""

from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.episode import Query
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.places import places_by_object, spread_m
from app.pipeline.findings.recording_ends import ENDS_SHARE, MIN_ENDS, MOVES_M_S, ONE_PLACE_M, PLACES_M, Recorded
from app.pipeline.plans.rows import left_out_errors_m
from app.pipeline.thresholds import WAY_SHARE
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import Pose

EXPLAINED, MIN_LINEAR = 0.7, 6  # starts that depend on an object leave less of their scatter; of so many recordings


def begun_late_findings(pairs: Sequence[Recorded]) -> Iterator[Finding]:
    """Yield a finding where recordings begin on the way to an object or at it, and do not show how the hand gets there.

    Robots start in one place, or anywhere: where objects are does not explain it, unless one is in the hand.
    """
    starts_m = np.array([hand.start.position_m for _, hand in pairs])
    if len(pairs) < MIN_ENDS or spread_m(starts_m) < PLACES_M:
        return
    near = np.linalg.norm(starts_m[:, None] - starts_m[None], axis=2) < ONE_PLACE_M
    home = near[near.sum(axis=1).argmax()]
    away = [pair for pair, at_home in zip(pairs, home, strict=True) if not at_home]
    if home.mean() > WAY_SHARE:
        late = len(away) > WAY_SHARE * len(pairs) and (_most_move(away) or _depend_on_objects(away))
    else:
        away = list(pairs)
        late = _depend_on_objects(pairs) and not _most_hold(pairs)
    if late:
        message = (
            f"{len(away)} of {len(pairs)} recordings begin on the way to an object or at it, and do not show how the"
            " hand gets there. Begin to record where the robot starts, before it moves."
        )
        yield rules.BEGUN_LATE.finding(message, "demonstrations")


def begins_there(now: Pose | None, scene: Query, pairs: Sequence[Recorded]) -> bool:
    """Return whether the hand is now where recordings begin, seen from an object: at a drawer that it has opened."""
    if now is None or len(pairs) < MIN_ENDS:
        return False
    now_m = places_by_object([scene], np.array([now.position_m]))
    seen_m = places_by_object([shown for shown, _ in pairs], np.array([hand.start.position_m for _, hand in pairs]))
    one_place = {key: np.median(m, axis=0) for key, m in seen_m.items() if key in now_m and spread_m(m) < ONE_PLACE_M}
    return any(float(np.linalg.norm(now_m[key][0] - place_m)) < PLACES_M for key, place_m in one_place.items())


def _depend_on_objects(pairs: Sequence[Recorded]) -> bool:
    """Return whether hands start at one place seen from an object, or at a place that is linear in the object's."""
    starts_m = np.array([hand.start.position_m for _, hand in pairs])
    seen_m = places_by_object([shown for shown, _ in pairs], starts_m)
    if min(map(spread_m, seen_m.values()), default=np.inf) < min(ONE_PLACE_M, ENDS_SHARE * spread_m(starts_m)):
        return len(pairs) >= MIN_ENDS
    places_m = [starts_m - off_m for (_, axes), off_m in seen_m.items() if axes == "w"]
    usual_m = _median_m(left_out_errors_m(np.zeros((len(starts_m), 0)), starts_m))
    explained = (_median_m(left_out_errors_m(place_m, starts_m)) < EXPLAINED * usual_m for place_m in places_m)
    return len(pairs) >= MIN_LINEAR and any(explained)


def _most_move(pairs: Sequence[Recorded]) -> bool:
    """Return whether most hands move in the first moments."""
    return 2 * sum(hand.start_speed_m_s > MOVES_M_S for _, hand in pairs) > len(pairs)


def _most_hold(pairs: Sequence[Recorded]) -> bool:
    """Return whether most hands start closed, with an object in them."""
    return 2 * sum(not hand.starts_open and bool(hand.may_hold) for _, hand in pairs) > len(pairs)


def _median_m(errors_m: Array) -> float:
    return float(np.median(np.linalg.norm(errors_m, axis=1)))
