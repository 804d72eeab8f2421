"""What no recorded hand can have done, or not with these words: all recordings may agree on it and be wrong.

A gripper that is said to be open where it is closed, a motion that runs backwards in time, recordings that break off, a
hand in another frame than the objects, quaternions with w first.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.elsewhere import role_of
from app.pipeline.findings.hand import AT_OBJECT_M, RecordedHand
from app.pipeline.findings.rules import Rule
from app.pipeline.order.order import Order
from app.pipeline.plans.rows import PlanRow, touching_rows
from app.pipeline.plans.support import Support
from app.pipeline.representation.anchors import asked_anchor
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array

# The first words of verbs, see `app.pipeline.order.verbs`
PRESSING = frozenset({"push", "press", "tap", "hit", "poke", "click", "depress"})
TAKING = frozenset({"pick", "grasp", "grab", "grip", "take", "lift", "get", "remove", "destack", "unstack"})
HOLDING = frozenset({"grasp", "grab", "grip", "hold", "squeeze", "pinch"})  # done once fingers are closed
PUTTING = frozenset({"put", "place", "position", "set", "lay", "stack", "pile", "insert", "hang"})
# What the instruction says to take or press, where it follows right upon the verb
DIRECT_OBJECT = re.compile(r"(?P<verb>\w+)( (up|down|off|away))? ((the|a|an) )?<0>")
CARRIES_M = 0.05
MOVES_M_S = 0.05
STILL_M = 0.02  # a hand that moves less after it has closed does nothing with what it holds; 10 degrees are 1 cm
ACTED_M = 0.08  # a hand that comes no nearer to any object has not acted yet
FEWEST = 4  # recordings that tell what their ends share from chance
SLIPS = 0.2  # share of the recordings that may be odd
ONE_PLACE_M, PLACES_M = 0.02, 0.05  # spread of ends that are one, of starts that are several
ARRIVES_M = 0.035  # spread of ends of hands that still move, seen from what they carry something to
MIN_TURNED = 5  # demonstrations that show how hands turn with objects
TURNS_DEG = 8.0  # what turns by less has hardly been turned
MUCH_LESS = 1 / 3

UNHELD = (
    "the hand starts closed and empty, opens at an object and goes on with open fingers: is gripper_open inverted, or"
    " is what the hand holds from the start not among the objects?"
)
PRESSES_OPEN = "the hand opens, and never closes again, to press something: is gripper_open inverted?"
TAKES_NOTHING = "the gripper closes on nothing, though the instruction says to take something."
TAKES_ANOTHER = "the hand closes far from what the instruction says to take, and near another object."
ONLY_OPENS = (
    "the hand opens at what the instruction says to take, and closes elsewhere or never: is gripper_open inverted, or"
    " does the recording run backwards?"
)
KEEPS_HOLD = "the hand closes and never opens again, though the instruction says to put something down."
TAKES_NOWHERE = "the hand closes on something, and the recording ends there: record what it then does."
CUT_OFF = "the hand is still on its way in the last frame: record until it has done everything and rests."


def hand_findings(alike: Sequence[Demonstration], hands: Sequence[RecordedHand]) -> Iterator[Finding]:
    """What is implausible in more than a third of the recordings of one instruction, and what all of them share.

    Args:
        alike: that ask for the same, with their hands.
    """
    if not hands:
        return
    found = [_fault(demonstration, hand) for demonstration, hand in zip(alike, hands, strict=True)]
    if _carry_to_one_place([pair for pair in zip(alike, hands, strict=True) if pair[1].ends_holding]):
        found = [(rules.ARRIVES, CUT_OFF) if item == (rules.BROKEN_OFF, CUT_OFF) else item for item in found]
    for rule, fault in dict.fromkeys(item for item in found if item is not None):
        number = sum(item is not None and item[1] == fault for item in found)
        message, share = f"In {number} of {len(alike)} recordings {fault}", number / len(alike)
        yield from rule.findings(share, message, "demonstrations", {"share": share})
    far_m = float(np.median([_acts_away_m(item, hand) for item, hand in zip(alike, hands, strict=True)]))
    message = (
        f"Where it should act, the hand is {100 * far_m:.0f} cm from the nearest object in most recordings: are hand"
        " and objects in one frame, and are all objects listed?"
    )
    yield from rules.FAR_FROM_ALL.findings(far_m, message, "demonstrations", {"nearest_m": far_m})
    yield from _backwards(alike, hands)


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


def _fault(demonstration: Demonstration, hand: RecordedHand) -> tuple[Rule, str] | None:
    verb = demonstration.order.clauses[0].verb
    if (fault := _gripper_fault(demonstration, hand)) is not None:
        return rules.IMPLAUSIBLE_GRIPPER, fault
    if verb in PUTTING and hand.ends_holding and not any(act.opens for act in hand.acts):
        return rules.BROKEN_OFF, KEEPS_HOLD
    if verb not in HOLDING | PRESSING and hand.ends_holding and len(hand.acts) == 1 and hand.acts[0].moved_m < STILL_M:
        return rules.BROKEN_OFF, TAKES_NOWHERE
    carries = hand.ends_holding and verb not in TAKING
    comes = hand.nearest_m > ACTED_M or (hand.still_comes and not hand.acts)
    return (rules.BROKEN_OFF, CUT_OFF) if hand.end_speed_m_s > MOVES_M_S and (carries or comes) else None


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
    if taken is None or taken in hand.may_hold or any(act.away_m[taken] < AT_OBJECT_M for act in closings):
        return None
    if any(act.away_m[taken] < AT_OBJECT_M for act in hand.acts):
        return ONLY_OPENS
    return TAKES_ANOTHER if closings and closings[0].nearest_m < AT_OBJECT_M else None


def _carry_to_one_place(carrying: Sequence[tuple[Demonstration, RecordedHand]]) -> bool:
    """Whether hands that end with something in them end in one place, seen from an object, and took it elsewhere.

    What is broken off ends on the way from one to the other, and seen from neither in one place.
    """
    if len(carrying) < FEWEST:
        return False
    held_m, others_m = [], []
    for demonstration, hand in carrying:
        away_m = hand.acts[-1].away_m
        role = role_of(demonstration, min(away_m, key=away_m.__getitem__))
        seen_m = _seen_by_role(demonstration, hand.end_m)
        held_m.append(seen_m[role, "w"])
        others_m.append({key: place_m for key, place_m in seen_m.items() if key[0] != role})
    shared = set(others_m[0]).intersection(*others_m)
    arrives = any(_spread_m(np.array([seen[key] for seen in others_m])) < ARRIVES_M for key in shared)
    return arrives and _spread_m(np.array(held_m)) > PLACES_M


def _backwards(alike: Sequence[Demonstration], hands: Sequence[RecordedHand]) -> Iterator[Finding]:
    """Motions that end in one place and start where an object is, or end where others start: robots start in one."""
    if len(hands) < FEWEST:
        return
    starts_m, ends_m = np.array([hand.start.position_m for hand in hands]), np.array([hand.end_m for hand in hands])
    number = _end_where_others_start(starts_m, ends_m)
    if number > SLIPS * len(hands):
        message = f"{number} of {len(hands)} recordings end where others start, and start elsewhere: backwards in time?"
        yield rules.BACKWARDS.finding(message, "demonstrations")
        return
    if _spread_m(ends_m) > ONE_PLACE_M or _spread_m(starts_m) < PLACES_M:
        return
    seen_m = [
        _seen_by_role(demonstration, hand.start.position_m) for demonstration, hand in zip(alike, hands, strict=True)
    ]
    shared = set(seen_m[0]).intersection(*seen_m)
    if any(_spread_m(np.array([seen[key] for seen in seen_m])) < ONE_PLACE_M for key in shared):
        message = (
            "The recordings end with the hand in one place, and start with it where an object implies: do they run"
            " backwards in time?"
        )
        yield rules.BACKWARDS.finding(message, "demonstrations")


def _end_where_others_start(starts_m: Array, ends_m: Array) -> int:
    near = np.linalg.norm(starts_m[:, None] - starts_m[None], axis=2) < ONE_PLACE_M
    home_m = starts_m[near.sum(axis=1).argmax()]
    away_m, back_m = (np.linalg.norm(places_m - home_m, axis=1) for places_m in (starts_m, ends_m))
    several = (away_m < ONE_PLACE_M).sum() > SLIPS * len(starts_m)
    return int(((away_m > PLACES_M) & (back_m < ONE_PLACE_M)).sum()) if several else 0


def _seen_by_role(demonstration: Demonstration, place_m: Array) -> Mapping[tuple[str, str], Array]:
    """Where a place is, seen from each object: along the world's axes and, where they are known, its own."""
    found: dict[tuple[str, str], Array] = {}
    for pose in demonstration.objects:
        role, way_m = role_of(demonstration, pose.name), place_m - pose.position_m
        found[role, "w"] = way_m
        if pose.quaternion_xyzw is not None:
            found[role, "o"] = quaternions.rotated(quaternions.inverse(pose.quaternion_xyzw), way_m)
    return found


def _spread_m(places_m: Array) -> float:
    """How far most places (N, 3) are from their median."""
    return float(np.quantile(np.linalg.norm(places_m - np.median(places_m, axis=0), axis=1), 0.8))


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
