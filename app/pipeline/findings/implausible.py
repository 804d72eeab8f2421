"""What no recorded hand can have done, or not with these words: all recordings may agree on it and be wrong.

A gripper that is said to be open where it is closed, a motion that runs backwards in time, recordings that break off, a
hand that is far from all objects.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.ends import PRESSING, PUTTING, TAKING, backwards_findings, end_faults
from app.pipeline.findings.hand import AT_OBJECT_M, RecordedHand
from app.pipeline.findings.turning import MIN_TURNED, MUCH_LESS
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

# What the instruction says to take or press, where it follows right upon the verb
DIRECT_OBJECT = re.compile(r"(?P<verb>\w+)( (up|down|off|away))? ((the|a|an) )?<0>")
CARRIES_M = 0.05
ASIDE_M = 0.05  # from every object: a hand that closes there, and comes to one before or after, cannot hold it
PART_M = 0.02  # rms of the places at which hands grasp one part of an object

UNHELD = (
    "the hand starts closed and empty, and opens at an object: is gripper_open inverted, or what it holds not listed?"
)
PRESSES_OPEN = "the hand opens, and never closes again, to press something: is gripper_open inverted?"
TAKES_NOTHING = "the gripper closes on nothing, though the instruction says to take something."
TAKES_ANOTHER = "the hand closes far from what the instruction says to take, and near another object."
ONLY_OPENS = (
    "the hand opens at what it should take, and closes elsewhere or never: gripper_open inverted, or time reversed?"
)
CLOSES_ASIDE = (
    "the gripper closes before the hand comes to what it takes, or after it has left: is gripper_open a command, or its"
    " clock early or late?"
)
FLICKERS = "the gripper switches to and fro within 0.3 s: does the width tremble about gripper_open_above_m?"
LEAPS = "the hand is suddenly elsewhere: frames are missing, out of order, or of two recordings that were joined."


def hand_findings(alike: Sequence[Demonstration], hands: Sequence[RecordedHand]) -> Iterator[Finding]:
    """What is implausible in more than a third of the recordings of one instruction, and what all of them share.

    Args:
        alike: that ask for the same, with their hands.
    """
    if not hands:
        return
    pairs = list(zip(alike, hands, strict=True))
    gripper = [_recorder_fault(hand) or _gripper_fault(shown, hand) for shown, hand in pairs]
    ends = end_faults(pairs)
    found = [(rules.IMPLAUSIBLE_GRIPPER, fault) if fault else end for fault, end in zip(gripper, ends, strict=True)]
    for (rule, fault), number in Counter(item for item in found if item is not None).items():
        message, share = f"In {number} of {len(alike)} recordings {fault}", number / len(alike)
        yield from rule.findings(share, message, "demonstrations", {"share": share})
    far_m = 0.0 if _acts_on_a_part(pairs) else float(np.median([_acts_away_m(*pair) for pair in pairs]))
    message = (
        f"Where it should act, the hand is {100 * far_m:.0f} cm from the nearest object in most recordings: are hand"
        " and objects in one frame, and are all objects listed?"
    )
    yield from rules.FAR_FROM_ALL.findings(far_m, message, "demonstrations", {"nearest_m": far_m})
    yield from backwards_findings(pairs)


def dropping_findings(hands: Sequence[RecordedHand]) -> Iterator[Finding]:
    """Of demonstrations that are to be done one after the other: the hand ends with something, and starts open.

    Args:
        hands: of those that are strung together.
    """
    holding = sum(hand.ends_holding and hand.starts_open for hand in hands)
    if 2 * holding > len(hands):
        message = "Demonstrations end with something in the hand: it falls when the next part begins with open fingers."
        yield rules.DROPS.finding(message, "instruction")


def _acts_away_m(demonstration: Demonstration, hand: RecordedHand) -> float:
    """From the nearest object where the hand closes to take something; without that, where it comes nearest to one."""
    closed_m = [act.nearest_m for act in hand.acts if not act.opens]
    takes = demonstration.order.clauses[0].verb in TAKING | PUTTING and hand.starts_open and closed_m
    return closed_m[0] if takes else hand.nearest_m


def _acts_on_a_part(pairs: Sequence[tuple[Demonstration, RecordedHand]]) -> bool:
    """Whether the hand acts at one place along the axes of an object that turns, as at the handle of a pan.

    A hand in another frame would be on one side as the world has it.
    """
    if len(pairs) < MIN_TURNED:
        return False
    acts_m = np.array([hand.acts_at[0].position_m for _, hand in pairs])
    by_mention = zip(*(shown.ordered_objects for shown, _ in pairs), strict=False)
    return any(_turns_along(acts_m, poses) for poses in by_mention)


def _turns_along(places_m: Array, poses: Sequence[ObjectPose]) -> bool:
    turned = [pose.quaternion_xyzw for pose in poses if pose.quaternion_xyzw is not None]
    if len(turned) < len(poses):
        return False
    aside_m = places_m - np.array([pose.position_m for pose in poses])
    along_m = Rotation.from_quat(np.array(turned)).inv().apply(aside_m)
    along_rms_m, aside_rms_m = (float(np.sqrt(each.var(axis=0).sum())) for each in (along_m, aside_m))
    return along_rms_m < PART_M and along_rms_m < MUCH_LESS * aside_rms_m


def _recorder_fault(hand: RecordedHand) -> str | None:
    if hand.leaps:
        return LEAPS
    return FLICKERS if hand.flickers else None


def _gripper_fault(demonstration: Demonstration, hand: RecordedHand) -> str | None:
    clause = demonstration.order.clauses[0]
    found = DIRECT_OBJECT.match(clause.form)
    taken = clause.objects[0] if found and found["verb"] in TAKING | PUTTING else None
    closings = [act for act in hand.acts if not act.opens]
    lets_go = bool(hand.acts) and hand.acts[0].opens and hand.acts[0].at_object and hand.acts[0].moved_m > CARRIES_M
    if lets_go and not hand.may_hold:  # nor comes to take it
        return UNHELD
    if clause.verb in PRESSING and hand.acts and not closings and not hand.may_hold:
        return PRESSES_OPEN
    if clause.verb in TAKING | PUTTING and not hand.acts:
        return TAKES_NOTHING
    first = closings[0] if closings else None
    if first and clause.verb in TAKING | PUTTING and first.nearest_m > max(ASIDE_M, 2 * first.least_m):
        return CLOSES_ASIDE
    if taken is None or taken in hand.may_hold or any(act.away_m[taken] < AT_OBJECT_M for act in closings):
        return None
    if any(act.away_m[taken] < AT_OBJECT_M for act in hand.acts):
        return ONLY_OPENS
    return TAKES_ANOTHER if closings and closings[0].nearest_m < AT_OBJECT_M else None
