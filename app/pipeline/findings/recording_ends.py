"""Both ends of recordings: they begin late, break off, stop as soon as everything is done, or run backwards in time."""

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.acts import AT_OBJECT_M
from app.pipeline.findings.hand import RecordedHand
from app.pipeline.findings.places import places_by_object, spread_m
from app.pipeline.findings.rules import Rule
from app.pipeline.order.grasps import goes_somewhere, puts_down
from app.pipeline.order.verbs import FETCHING, HOLDING, PRESSING, REACHING, TAKING
from app.pipeline.plans.rows import left_out_m
from app.pipeline.thresholds import WAY_SHARE
from roboprompt_client.types.arrays import Array

MOVES_M_S = 0.05
STILL_M = 0.02  # a hand that moves less after it has closed does nothing with what it holds; 10 degrees are 1 cm
ACTED_M = 0.08  # a hand that comes no nearer to any object has hardly acted yet
DONE_ACTS = 2  # a hand that closes and opens again has acted, though the handle may be far from the object's origin
MIN_ENDS = 4  # recordings that show what their ends share other than by chance
ODD_SHARE = 0.2  # of the recordings may differ from the others
ONE_PLACE_M, PLACES_M = 0.02, 0.05  # spread of ends that are one place, of starts that are several
ENDS_SHARE = 0.4  # of the spread of starts, for ends to be where robots start: that varies, too, by less than PLACES_M
COMPLETE_M = 0.035  # spread, seen from an object, of hands that still move in their last frame and have done everything
COMPLETE_ALONG_M = 0.008  # the same along x or y alone, where the ends are several places in the world
SPREAD_M = 0.10  # of starts that are not one place
# Of at least `MIN_LINEAR` recordings, starts that depend on an object leave less than this share of their scatter: the
# first where most hands move at first, the second where more than `ODD_SHARE` do
EXPLAINED, WELL_EXPLAINED, MIN_LINEAR = 0.7, 0.3, 6
LEVEL_M = 0.08  # what is carried and ends higher or lower than this beside an object is not put to it

TAKES_NOWHERE = "the hand closes on something, and the recording ends there: record what it then does."
KEEPS_HOLD = "the hand closes and never opens again, though the instruction says to put something down."
CUT_OFF = "the hand is still moving to an object or with one in the last frame: record until it rests."

Fault = tuple[Rule, str]
"""A rule and the message of its finding."""
Recorded = tuple[Demonstration, RecordedHand]


def end_faults(pairs: Sequence[Recorded]) -> list[Fault | None]:
    """Return for each demonstration whether its recording breaks off.

    Recordings of which the last frames show that everything is done, though hands still move, are only a warning.

    Args:
        pairs: demonstrations that ask for the same, with their hands.
    """
    messages = [_end_fault(*pair) for pair in pairs]
    found: list[Fault | None] = [(rules.BROKEN_OFF, message) if message else None for message in messages]
    all_hold = all(hand.ends_holding for _, hand in pairs)
    for holds in (True, False):
        indices = [k for k, (_, hand) in enumerate(pairs) if hand.ends_holding == holds]
        for k in indices if _end_complete([pairs[k] for k in indices]) else ():
            if messages[k] == CUT_OFF or (messages[k] == KEEPS_HOLD and all_hold and _still_puts(*pairs[k])):
                found[k] = rules.BROKEN_OFF_COMPLETE, str(messages[k])
    return found


def _end_fault(demonstration: Demonstration, hand: RecordedHand) -> str | None:
    verb, puts = demonstration.order.clauses[0].verb, puts_down(demonstration.order)
    if puts and hand.ends_holding and not any(act.opens for act in hand.acts):
        return KEEPS_HOLD
    if verb not in HOLDING | PRESSING and hand.ends_holding and len(hand.acts) == 1 and hand.acts[0].moved_m < STILL_M:
        return TAKES_NOWHERE
    carries = hand.ends_holding and (puts or verb not in TAKING or goes_somewhere(demonstration.order))
    comes = (hand.nearest_m > ACTED_M and len(hand.acts) < DONE_ACTS) or (hand.still_comes and not hand.acts)
    has_acted = verb in FETCHING and hand.slides
    return CUT_OFF if hand.end_speed_m_s > MOVES_M_S and (carries or (comes and not has_acted)) else None


def _end_complete(pairs: Sequence[Recorded]) -> bool:
    """Return whether hands that still move in their last frames have done everything there.

    Their ends are then one place seen from an object, at least along x or y, though paths and durations differ, and
    most hands have acted before. Recordings that are broken off on the way from one object to another end in one place
    seen from neither.

    Args:
        pairs: all end with something in the hand, or all without.
    """
    if len(pairs) < MIN_ENDS:
        return False
    ends_m = np.array([hand.end_m for _, hand in pairs])
    seen_m = places_by_object([shown for shown, _ in pairs], ends_m)
    counts = Counter(shown.order.placeholder(hand.acts[-1].nearest) for shown, hand in pairs if hand.ends_holding)
    held = {role for role, number in counts.items() if number > ODD_SHARE * len(pairs)}
    if not any(_agree(places_m, ends_m) for (role, _), places_m in seen_m.items() if role not in held):
        return False
    if held:  # what is carried was taken elsewhere
        return all(spread_m(seen_m[role, "w"]) > PLACES_M for role in held)
    return 2 * sum(_has_acted(*pair) for pair in pairs) > len(pairs)


def _agree(seen_m: Array, ends_m: Array) -> bool:
    """Return whether ends (N, 3) are one place seen from an object, `seen_m` (N, 3), at least along x or y."""
    along = zip(seen_m[:, :2].T, ends_m[:, :2].T, strict=True)
    follows = (spread_m(own[:, None]) < COMPLETE_ALONG_M and spread_m(m[:, None]) > ONE_PLACE_M for own, m in along)
    return spread_m(seen_m) < COMPLETE_M or any(follows)


def _has_acted(demonstration: Demonstration, hand: RecordedHand) -> bool:
    """Return whether a hand that holds nothing came to an object and went on, or the words only ask to come there."""
    reaches = not REACHING.isdisjoint(demonstration.order.verbs)
    return hand.nearest_m < AT_OBJECT_M and (reaches or hand.dips or not hand.still_comes)


def _still_puts(demonstration: Demonstration, hand: RecordedHand) -> bool:
    """Return whether what a moving hand carries is at the height of another object in the last frame."""
    held = demonstration.object(hand.acts[-1].nearest)
    carried_to_m = held.position_m[2] + hand.end_m[2] - hand.acts_at[0].position_m[2]
    heights_m = [pose.position_m[2] for pose in demonstration.objects if pose is not held]
    return hand.end_speed_m_s > MOVES_M_S and any(abs(height_m - carried_to_m) < LEVEL_M for height_m in heights_m)


def backwards_findings(pairs: Sequence[Recorded]) -> Iterator[Finding]:
    """Yield a finding where recordings seem to run backwards in time, since robots start in one place.

    They end in one place and start at one place seen from an object, or some end where others start.
    """
    if len(pairs) < MIN_ENDS:
        return
    starts_m, ends_m = np.array([hand.start.position_m for _, hand in pairs]), np.array([h.end_m for _, h in pairs])
    number = _end_where_others_start(starts_m, ends_m)
    starts_vary_m, ends_vary_m, message = spread_m(starts_m), spread_m(ends_m), ""
    if number > ODD_SHARE * len(pairs):
        message = f"{number} of {len(pairs)} recordings end where the others start, and start elsewhere."
    elif starts_vary_m >= PLACES_M and ends_vary_m <= min(ENDS_SHARE * starts_vary_m, PLACES_M):
        seen_m = places_by_object([shown for shown, _ in pairs], starts_m)
        if min(map(spread_m, seen_m.values()), default=np.inf) < ONE_PLACE_M:
            message = f"The {len(pairs)} recordings end in one place, and start at one place relative to an object."
    if message:
        message += " They probably run backwards in time: check the order of their frames."
        yield rules.BACKWARDS_IN_TIME.finding(message, "demonstrations")


def _end_where_others_start(starts_m: Array, ends_m: Array) -> int:
    """Return how many recordings end where most others start, and start elsewhere themselves."""
    near = np.linalg.norm(starts_m[:, None] - starts_m[None], axis=2) < ONE_PLACE_M
    home_m = starts_m[near.sum(axis=1).argmax()]
    away_m, back_m = (np.linalg.norm(places_m - home_m, axis=1) for places_m in (starts_m, ends_m))
    several = (away_m < ONE_PLACE_M).sum() > ODD_SHARE * len(starts_m)
    return int(((away_m > PLACES_M) & (back_m < ONE_PLACE_M)).sum()) if several else 0


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
        number = len(away) if _share_moving(away) > 1 / 2 or _in_one_place(away) else 0
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


def begun_holding_findings(pairs: Sequence[Recorded]) -> Iterator[Finding]:
    """Yield a finding where some recordings begin with an object in the hand, and others show how the hand takes it."""
    holding, taking = sum(_begins_holding(hand) for _, hand in pairs), sum(_begins_taking(hand) for _, hand in pairs)
    if holding > WAY_SHARE * len(pairs) and taking > ODD_SHARE * len(pairs):
        message = (
            f"{holding} of {len(pairs)} recordings begin with an object in the hand, and {taking} show how the hand"
            " takes it. Begin all of them where the robot starts, before it moves."
        )
        yield rules.BEGUN_LATE.finding(message, "demonstrations", value=1.0)


def _in_one_place(pairs: Sequence[Recorded]) -> bool:
    starts_m = np.array([hand.start.position_m for _, hand in pairs])
    spreads_m = map(spread_m, places_by_object([shown for shown, _ in pairs], starts_m).values())
    return len(pairs) >= MIN_ENDS and min(spreads_m, default=np.inf) < min(ONE_PLACE_M, ENDS_SHARE * spread_m(starts_m))


def _on_the_way(pairs: Sequence[Recorded]) -> bool:
    """Return whether hands move in the first moments, at places that are linear in those of an object."""
    moving = _share_moving(pairs)
    if len(pairs) < MIN_LINEAR or moving <= ODD_SHARE:
        return False
    most_left = EXPLAINED if moving > 1 / 2 else WELL_EXPLAINED
    starts_m = np.array([hand.start.position_m for _, hand in pairs])
    seen_m = places_by_object([shown for shown, _ in pairs], starts_m)
    usual_m = left_out_m(np.zeros((len(starts_m), 0)), starts_m)
    places_m = (starts_m - m for (_, axes), m in seen_m.items() if axes == "w")
    return any(left_out_m(place_m, starts_m) < most_left * usual_m for place_m in places_m)


def _share_moving(pairs: Sequence[Recorded]) -> float:
    return sum(hand.start_speed_m_s > MOVES_M_S for _, hand in pairs) / len(pairs)


def _begins_holding(hand: RecordedHand) -> bool:
    return not hand.starts_open and bool(hand.may_hold) and bool(hand.acts) and hand.acts[0].opens


def _begins_taking(hand: RecordedHand) -> bool:
    return hand.starts_open and bool(hand.acts) and not hand.acts[0].opens and hand.acts[0].at_object


def _most_hold(pairs: Sequence[Recorded]) -> bool:
    return 2 * sum(not hand.starts_open and bool(hand.may_hold) for _, hand in pairs) > len(pairs)
