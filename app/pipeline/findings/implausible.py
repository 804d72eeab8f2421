"""What no recorded hand can have done, or not with these words: all recordings may agree on it and be wrong.

A gripper that is said to be open where it is closed, a motion that runs backwards in time, recordings that break off, a
hand in another frame than the objects, quaternions with w first.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.ends import PRESSING, PUTTING, TAKING, backwards_findings, end_faults
from app.pipeline.findings.hand import AT_OBJECT_M, RecordedHand
from app.pipeline.order.order import Order
from app.pipeline.plans.rows import PlanRow, touching_rows
from app.pipeline.plans.support import Support
from app.pipeline.representation.anchors import asked_anchor
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

# What the instruction says to take or press, where it follows right upon the verb
DIRECT_OBJECT = re.compile(r"(?P<verb>\w+)( (up|down|off|away))? ((the|a|an) )?<0>")
CARRIES_M = 0.05
EARLY_M = 0.05  # from every object: a hand that closes there, and then comes to one, cannot hold it
MIN_TURNED = 5  # demonstrations that show how hands turn with objects
TURNS_DEG = 8.0  # what turns by less has hardly been turned
MUCH_LESS = 1 / 3
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
CLOSES_EARLY = (
    "the gripper closes before the hand comes to what it takes: is gripper_open a command, or its clock early?"
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
    in_all = set.intersection(*({pose.name for pose in shown.objects} for shown, _ in pairs))
    return any(_turns_along(acts_m, [shown.object(name) for shown, _ in pairs]) for name in in_all)


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
    if first and clause.verb in TAKING | PUTTING and first.nearest_m > EARLY_M and first.later_m < first.nearest_m / 2:
        return CLOSES_EARLY
    if taken is None or taken in hand.may_hold or any(act.away_m[taken] < AT_OBJECT_M for act in closings):
        return None
    if any(act.away_m[taken] < AT_OBJECT_M for act in hand.acts):
        return ONLY_OPENS
    return TAKES_ANOTHER if closings and closings[0].nearest_m < AT_OBJECT_M else None


class Turning(NamedTuple):
    """A row in which the hand acts on an object whose rotations are known.

    Attributes:
        name: of the object, as it is asked for.
        hands_xyzw, objects_xyzw: (N, 4) in the demonstrations.
    """

    row: PlanRow
    name: str
    hands_xyzw: Array
    objects_xyzw: Array

    def beside_m(self) -> float:
        """How far beside the object the hand acts, where it turns with the object and its place does not; else 0."""
        with_object_deg, with_world_deg = self._scatters_deg(self.hands_xyzw)
        turns_with_it = with_world_deg > TURNS_DEG and with_object_deg < MUCH_LESS * with_world_deg
        is_beside = turns_with_it and not self.row.anchors[0].place_turns
        return float(np.linalg.norm(self.row.center_m[:2])) if is_beside else 0.0

    def astray_deg(self) -> float:
        """How far the hand scatters about object and world, where it would about neither if w came first; else 0."""
        as_read_deg = min(self._scatters_deg(self.hands_xyzw))
        as_meant_deg = min(self._scatters_deg(np.roll(self.hands_xyzw, -1, axis=1)))
        return as_read_deg if as_meant_deg < MUCH_LESS * as_read_deg else 0.0

    def _scatters_deg(self, hands_xyzw: Array) -> tuple[float, float]:
        """How far rotations of the hand scatter, seen from the object and seen from the world."""
        hands, objects = Rotation.from_quat(hands_xyzw), Rotation.from_quat(self.objects_xyzw)
        return _scatter_deg(objects.inv() * hands), _scatter_deg(hands)


def turning_findings(support: Support, asked: Order) -> Iterator[Finding]:
    """At most one doubt of each kind about the rows in which the hand acts on an object."""
    turning = list(_turning(support, asked))
    if not turning:
        return
    item = max(turning, key=Turning.beside_m)
    far_m = item.beside_m()
    message = (
        f"The hand turns with {item.name}, but acts {100 * far_m:.0f} cm beside it, on one side as the world has it,"
        " however it is turned: are hand and objects in one frame?"
    )
    yield from rules.BESIDE.findings(far_m, message, f"objects[{item.name}]", {"beside_m": far_m})
    item = max(turning, key=Turning.astray_deg)
    off_deg = item.astray_deg()
    message = (
        f"Where the hand acts, it is turned by {off_deg:.0f} degrees this way and that; with w first in its"
        f" quaternions it would turn as {item.name} does. They must be x y z w."
    )
    yield from rules.W_FIRST.findings(off_deg, message, "demonstrations", {"off_deg": off_deg})


def _turning(support: Support, asked: Order) -> Iterator[Turning]:
    for group, rows in support.alike(asked):
        for k in touching_rows(rows) if len(group) >= MIN_TURNED else ():
            names = [anchor.object_name for anchor in rows[k].anchors]
            if not all(names):
                continue
            turned = [d.object(name).quaternion_xyzw for d, name in zip(group, names, strict=True)]
            objects_xyzw = [turn for turn in turned if turn is not None]
            if len(objects_xyzw) == len(group):
                hands_xyzw = np.array([demonstration.actions[k].quaternion_xyzw for demonstration in group])
                name = asked_anchor(rows[k].anchors[0], group[0].order, asked).object_name
                yield Turning(rows[k], name, hands_xyzw, np.array(objects_xyzw))


def _scatter_deg(rotations: Rotation) -> float:
    return float(np.degrees(np.median((rotations.mean().inv() * rotations).magnitude())))
