"""Gripper timing and other motions of recorded hands that are impossible, or that the words exclude.

All recordings may agree and be wrong: a gripper that is recorded as open where it is closed, a hand far from objects.
"""

import math
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.acts import AT_OBJECT_M, Act
from app.pipeline.findings.hand import RecordedHand
from app.pipeline.findings.places import MIN_TURNED, MUCH_LESS, places_by_object, spread_m
from app.pipeline.findings.recording_ends import (
    Recorded,
    backwards_findings,
    begun_holding_findings,
    begun_late_findings,
    end_faults,
)
from app.pipeline.order.grasps import put_to, shifts_something, taken
from app.pipeline.order.order import Order
from app.pipeline.order.verbs import FETCHING, GRIPPING, PRESSING, PUTTING, TAKING
from app.pipeline.plans.rows import of_a_way
from app.pipeline.thresholds import WAY_SHARE

CARRIES_M = 0.05  # a hand that moves farther with closed fingers carries something
ASIDE_M = 0.05  # from every object: a hand that closes there, and comes to one before or after, cannot hold it
GRASPED_AT_M = 0.02  # from an object's origin: the hand closes on that object
PART_M = 0.02  # spread of the places at which hands act on one part of an object

UNHELD = (
    "the hand starts closed and empty, and opens at an object. Check whether gripper_open is inverted, and list what"
    " the hand holds."
)
PRESSES_OPEN = "the hand opens, and never closes again, to press something. Check whether gripper_open is inverted."
TAKES_NOTHING = "the gripper closes on nothing, though the instruction says to take something."
TAKES_ANOTHER = "the hand closes far from what the instruction says to take, and near another object."
ONLY_OPENS = (
    "the hand opens at what it should take, and closes elsewhere or never. Check whether gripper_open is inverted, or"
    " the order of frames reversed."
)
TAKES_FROM_GOAL = (
    "the hand closes at what the instruction says to put something in or on, and opens elsewhere. Check whether the"
    " order of frames is reversed, or gripper_open inverted."
)
TAKES_TOO_FEW = (
    "the hand closes fewer times than the instruction names things to take. Check whether gripper_open has every grasp:"
    " fingers around something wide may count as open."
)
CLOSES_ASIDE = (
    "the gripper closes before the hand comes to what it takes, or after it has left. Record the measured state of the"
    " fingers, not the command, with the clock of the poses."
)
FLICKERS = "the gripper switches to and fro within 0.3 s. Check whether the width trembles about gripper_open_above_m."
LEAPS = (
    "the hand is suddenly elsewhere. Frames are missing, out of order, or of two recordings that were joined: record"
    " again."
)
OUTRUNS_JOINTS = (
    "the hand moves farther than the recorded joints can move it. Record both at one time, as they are measured: not"
    " smoothed, and 5 times a second or more. Send no joints if these are not all that move the hand."
)

UNTURNED = (
    "the hand's rotation is exactly 0 (0, 0, 0, 1) in every frame, as of a recorder that knows none. Record it; of a"
    " hand that cannot turn send the rotation that it has, e.g. (1, 0, 0, 0) if it points down."
)


def hand_findings(alike: Sequence[Demonstration], hands: Sequence[RecordedHand]) -> Iterator[Finding]:
    """Yield what is implausible in more than a third of the recordings of one instruction, and what all share."""
    if not hands:
        return
    pairs = list(zip(alike, hands, strict=True))
    on_a_part = _acts_on_a_part(pairs)
    faults = [
        (rules.IMPLAUSIBLE_GRIPPER, fault) if (fault := _fault(*pair, on_a_part)) else end
        for pair, end in zip(pairs, end_faults(pairs), strict=True)
    ]
    for (rule, fault), number in Counter(item for item in faults if item is not None).items():
        share, message = number / len(alike), f"In {number} of {len(alike)} recordings {fault}"
        yield from rule.findings(share, message, "demonstrations", share=share)
    far_m = 0.0 if on_a_part else float(np.median([_acts_away_m(*pair) for pair in pairs]))
    message = (
        f"Where it should act, the hand is {100 * far_m:.0f} cm from the nearest object in most recordings. Give hand"
        " and objects in one frame, and list all objects."
    )
    yield from rules.ACTS_FAR_FROM_OBJECTS.findings(far_m, message, "demonstrations", nearest_m=far_m)
    yield from _some_far_away(hands)
    yield from backwards_findings(pairs)
    yield from tuple(begun_holding_findings(pairs)) or begun_late_findings(pairs)


def dropping_findings(hands: Sequence[RecordedHand]) -> Iterator[Finding]:
    """Yield a finding if demonstrations that are to be done one after the other end with something in the hand."""
    holding = sum(hand.ends_holding and hand.starts_open for hand in hands)
    if 2 * holding > len(hands):
        message = (
            f"{holding} of {len(hands)} demonstrations end with something in the hand and start with open fingers: what"
            " is held falls when the next part begins. Ask for one part, or demonstrate them together."
        )
        yield rules.DROPS_WHAT_IT_HOLDS.finding(message, "instruction")


def _some_far_away(hands: Sequence[RecordedHand]) -> Iterator[Finding]:
    """Yield a finding if more than a third of the hands first close at an object, and another third at none."""
    closed_m = ([act.nearest_m for act in hand.acts if not act.opens] for hand in hands)
    away_m = np.array([own_m[0] if own_m else math.nan for own_m in closed_m])
    far_m = of_a_way(np.nan_to_num(away_m))
    message = (
        "In more than a third of the recordings the gripper closes at an object, and in another third"
        f" {100 * far_m:.0f} cm from the nearest one. Check whether some have another frame, or objects as they stand"
        " after the motion."
    )
    if (away_m < GRASPED_AT_M).mean() > WAY_SHARE:
        yield from rules.SOME_ACT_FAR_FROM_OBJECTS.findings(far_m, message, "demonstrations", nearest_m=far_m)


def _acts_away_m(demonstration: Demonstration, hand: RecordedHand) -> float:
    """Return the distance from the nearest object where the hand closes to take something, or comes nearest to one."""
    closed_m = [act.nearest_m for act in hand.acts if not act.opens]
    takes = demonstration.order.clauses[0].verb in TAKING | PUTTING and hand.starts_open and closed_m
    return closed_m[0] if takes else hand.nearest_m


def _acts_on_a_part(pairs: Sequence[Recorded]) -> bool:
    """Return whether the hand acts at one place along the axes of an object that turns, as at the handle of a pan.

    A hand in another frame would be on one side as the world has it.
    """
    if len(pairs) < MIN_TURNED:
        return False
    acts_m = np.array([hand.acts_at[0].position_m for _, hand in pairs])
    seen_m = {key: spread_m(m) for key, m in places_by_object([shown for shown, _ in pairs], acts_m).items()}
    own_m = {role: off_m for (role, axes), off_m in seen_m.items() if axes == "o"}
    beside = {role: seen_m[role, "w"] for role in own_m if seen_m[role, "w"] > PART_M}  # above it nothing turns
    return any(own_m[role] < min(PART_M, MUCH_LESS * world_m) for role, world_m in beside.items())


def _fault(demonstration: Demonstration, hand: RecordedHand, on_a_part: bool) -> str | None:
    """Return what is implausible in a recording: of the recorder, else of the gripper.

    Args:
        on_a_part: whether all hands act on one part of an object, which may be far from its origin.
    """
    if hand.leaps:
        return LEAPS
    if hand.outruns_joints:
        return OUTRUNS_JOINTS
    if hand.unturned:
        return UNTURNED
    return FLICKERS if hand.flickers else _gripper_fault(demonstration, hand, on_a_part)


def _gripper_fault(demonstration: Demonstration, hand: RecordedHand, on_a_part: bool) -> str | None:
    clause = demonstration.order.clauses[0]
    takes = clause.verb in TAKING | PUTTING
    closings = [act for act in hand.acts if not act.opens]
    lets_go = bool(hand.acts) and hand.acts[0].opens and hand.acts[0].at_object and hand.acts[0].moved_m > CARRIES_M
    if lets_go and not hand.may_hold:  # nor comes to take it
        return UNHELD
    if clause.verb in PRESSING and hand.acts and not closings and not hand.may_hold:
        return PRESSES_OPEN
    shifts = shifts_something(demonstration.order)
    grips = shifts or not (TAKING | PUTTING | GRIPPING).isdisjoint(demonstration.order.verbs)
    slides = hand.slides and (shifts or clause.verb in FETCHING)
    if grips and not closings and not slides and not (hand.acts and hand.may_hold):
        return TAKES_NOTHING
    if closings and (takes or hand.acts[-1].opens) and _closes_aside(closings, on_a_part):
        return CLOSES_ASIDE
    return _takes_otherwise(demonstration.order, hand, closings)


def _takes_otherwise(order: Order, hand: RecordedHand, closings: Sequence[Act]) -> str | None:
    """Return in what way the hand does not take the objects that words name, or takes something from its goal."""
    if _takes_from(put_to(order), hand.acts):
        return TAKES_FROM_GOAL
    wanted = taken(order)
    left = [name for name in wanted if name not in hand.may_hold and _is_far(name, closings)]
    if not left:
        return None
    if len(wanted) > 1:
        return TAKES_TOO_FEW if len(closings) < len(wanted) else None
    if not _is_far(left[0], hand.acts):
        return ONLY_OPENS
    return TAKES_ANOTHER if closings and closings[0].nearest_m < AT_OBJECT_M else None


def _takes_from(goals: Sequence[str], acts: Sequence[Act]) -> bool:
    closed, opened = ([act for act in acts if act.opens == opens] for opens in (False, True))
    taken_there = all(act.at_object and act.nearest in goals for act in closed)
    return bool(closed and opened) and taken_there and all(_is_far(name, opened) for name in goals)


def _is_far(name: str, acts: Sequence[Act]) -> bool:
    return all(act.away_m[name] >= AT_OBJECT_M for act in acts)


def _closes_aside(closings: Sequence[Act], on_a_part: bool) -> bool:
    """Return whether the hand first closes away from what it comes to, or closes as it passes by."""
    first = closings[0]
    far = first.nearest_m > max(ASIDE_M, 2 * first.least_m) and not (on_a_part and first.passes_over)
    return far or any(act.moves_on for act in closings)
