"""Demonstrations of one instruction that perform it in several ways, where nothing says which way is meant."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.hand import RecordedHand, Reversals
from app.pipeline.findings.places import AT_M, beside_m
from app.pipeline.findings.rules import SCATTER_OF_A_THIRD, SEVERAL_WAYS, WAY_BESIDE
from app.pipeline.geometry import least_apart_rad
from app.pipeline.groups import Group, usual_ways, words_decide
from app.pipeline.plans.acting import acting_rows
from app.pipeline.plans.by_scene import Parting, parting
from app.pipeline.plans.rows import PlanRow, plan_rows
from app.pipeline.plans.turn import grasps_along_approach, half_turned
from app.pipeline.plans.ways import TWO_WAYS_M, two_ways
from app.pipeline.thresholds import WAY_SHARE
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

IN_PLACE_M = 0.03  # a hand that moves less than this between two actions only turns
TURNED_APART_DEG = 40.0  # between hands of two ways, as between those of two plans
SCATTERS = 2.0  # two ways are farther apart than this many times the median within a way
TWISTS_DEG = 60.0  # a larger difference of the turns is another way; correct demonstrations differ by up to 9


def ways_findings(
    alike: Sequence[Demonstration],
    hands: Sequence[RecordedHand],
    yaw_symmetry_deg: Mapping[str, float],
    *,
    declared: bool,
) -> Iterator[Finding]:
    """Yield a finding if demonstrations use several ways and neither the words nor the scene select one.

    An error in half of the recordings looks like this: another base frame, an inverted gripper. Neighboring scenes
    often share a plan by chance; `parting` tests whether that is significant.

    Args:
        alike: demonstrations that ask for the same.
        hands: of their recordings; empty where they are not known.
        yaw_symmetry_deg: of objects with a declared symmetry, by which hands that are turned take them alike.
        declared: whether the task's setting `ways` is `several`.
    """
    more = more_strokes([hand.reversals for hand in hands]) if hands else None
    if more is not None:
        alike = [replace(shown, plan=int(makes_more)) for shown, makes_more in zip(alike, more, strict=True)]
    if words_decide(alike):
        return
    if (parted := parting(alike)) is not None:
        yield from () if declared else _beside_findings(parted, hands)
        return
    by_strokes = [tuple(shown for shown in alike if shown.plan == plan) for plan in (0, 1)]
    ways = _distinct_ways(usual_ways(alike), yaw_symmetry_deg) if more is None else by_strokes
    if len(ways) < 2:
        return
    numbers = " and ".join(str(len(way)) for way in ways)
    message = (
        f"{numbers} demonstrations of {alike[0].instruction!r} perform it in different ways, and neither the words nor"
        " the scene say which one to use."
    )
    if not declared:
        message += (
            " Check for recordings with another base frame, an inverted gripper, or more or fewer strokes. Delete the"
            ' wrong ones; if all are right, set the task\'s "ways" to "several".'
        )
    yield SEVERAL_WAYS.finding(message, "demonstrations", {"num_ways": len(ways)}, value=0.0 if declared else 1.0)


def _beside_findings(parted: Parting, hands: Sequence[RecordedHand]) -> Iterator[Finding]:
    """Yield a finding if one of the ways between which the scene decides acts at an object, and another beside all.

    A wrong frame, or an object that is seen elsewhere, in some of the recordings is separated by chance, too. Both act
    at one height; ways that push an object from several sides are all beside it.
    """
    if len(hands) < len(parted.demonstrations):
        return
    places_m = [hand.acts_at[0].position_m for hand in hands]
    away_m = [beside_m(place_m[None], shown)[0] for place_m, shown in zip(places_m, parted.demonstrations, strict=True)]
    acts_m = np.column_stack([away_m, np.array(places_m)[:, 2]])
    shown_ways = np.flatnonzero(np.bincount(parted.ways) > 1)
    ways_m = sorted(np.median(acts_m[parted.ways == way], axis=0).tolist() for way in shown_ways)
    (least_m, height_m), (far_m, other_m) = ways_m[0], ways_m[-1]
    message = (
        f"{parted.quantity.text} seems to decide between two ways, but in one of them the hand acts at an object, and"
        f" in the other {100 * far_m:.0f} cm beside every object. Check whether some recordings have another base frame"
        " or another object's pose."
    )
    if least_m < AT_M and abs(other_m - height_m) < TWO_WAYS_M:
        yield from WAY_BESIDE.findings(far_m, message, "demonstrations", beside_m=far_m)


def more_strokes(reversals: Sequence[Reversals]) -> Array | None:
    """Return (N,) bool: which recordings make more strokes, if more than a third do and more than a third do not.

    Another stroke is two more reversals; a single one may come from where the hand starts. None where all make about
    equally many, or some cannot be assigned to either.
    """
    certain, possible = np.array(reversals).reshape(-1, 2).T
    splits = [(certain >= number, possible <= number - 2) for number in np.unique(certain)]
    clear = (more for more, fewer in splits if (more | fewer).all() and min(more.mean(), fewer.mean()) > WAY_SHARE)
    return next(clear, None)


def _distinct_ways(ways: Sequence[Group], yaw_symmetry_deg: Mapping[str, float]) -> list[Group]:
    """Return the ways, those merged that differ only in how the hand gets to where it acts, or by its half turn."""
    found: list[Group] = []
    for way in ways:
        same = next((k for k, other in enumerate(found) if _same_outcome(other, way, yaw_symmetry_deg)), None)
        if same is None:
            found.append(way)
        else:
            found[same] += way
    return found


def _same_outcome(one: Group, other: Group, yaw_symmetry_deg: Mapping[str, float]) -> bool:
    """Return whether two ways act alike, or do so once the hand is turned by half a turn throughout one of them.

    A parallel gripper that is turned so grasps alike, and moves what it holds alike.
    """
    if _act_alike(one, other, yaw_symmetry_deg):
        return True
    turned = tuple(replace(shown, actions=tuple(map(half_turned, shown.actions))) for shown in other)
    return grasps_along_approach([*one, *other]) and _act_alike(one, turned, yaw_symmetry_deg)


def _act_alike(one: Group, other: Group, yaw_symmetry_deg: Mapping[str, float]) -> bool:
    aligned = all(len({len(shown.actions) for shown in way}) == 1 for way in (one, other))
    if abs(_twist_deg(one) - _twist_deg(other)) > TWISTS_DEG or not aligned:
        return False
    first, second = _acting_only(one), _acting_only(other)
    both = [*first, *second]
    if len({tuple(action.gripper_open for action in demonstration.actions) for demonstration in both}) > 1:
        return False
    rows = (row.unturned if row.anchors[0].object_name in yaw_symmetry_deg else row for row in plan_rows(both))
    each = zip(plan_rows(first), plan_rows(second), strict=True)
    if any(two_ways(row) is not None or SCATTER_OF_A_THIRD.severity(row.way_off_m) is not None for row in rows):
        return False
    return not any(_turned_apart(row, beside, yaw_symmetry_deg) for row, beside in each)


def _turned_apart(one: PlanRow, other: PlanRow, yaw_symmetry_deg: Mapping[str, float]) -> bool:
    """Return whether two ways turn the hand otherwise, seen from one frame of each; both together may have another.

    Hands on the axis of a round object may have any yaw; beside it, as at the rim of a cup, the yaw matters.
    """
    symmetry_deg = yaw_symmetry_deg.get(one.anchors[0].object_name, 360.0)
    aside_m = min(float(np.linalg.norm(row.center_m[:2])) for row in (one, other))
    if one.anchors[0] != other.anchors[0] or (symmetry_deg == 0 and aside_m < AT_M):
        return False
    turn_deg = math.degrees(least_apart_rad(one.mean_rotation, other.mean_rotation, symmetry_deg or 360.0).item())
    within_deg = max(float(np.median(row.off_deg)) for row in (one, other))
    return turn_deg > max(TURNED_APART_DEG, SCATTERS * within_deg)


def _acting_only(group: Group) -> list[Demonstration]:
    """Return the demonstrations with only those actions in which the hand acts, because ways differ in the others."""
    acting = acting_rows(plan_rows(group))
    return [replace(shown, actions=tuple(shown.actions[k] for k in acting)) for shown in group]


def _twist_deg(group: Group) -> float:
    """Return the median angle by which the closed hand turns about the vertical in place, as at a tap."""
    return float(np.degrees(np.median([_twist_rad(demonstration.actions) for demonstration in group])))


def _twist_rad(actions: Sequence[EndEffectorAction]) -> float:
    turns = [
        quaternions.product(then.quaternion_xyzw, quaternions.inverse(first.quaternion_xyzw))
        for first, then in pairwise(actions)
        if not first.gripper_open and np.linalg.norm(then.position_m - first.position_m) < IN_PLACE_M
    ]
    return sum(float(quaternions.to_rotation_vector(turn)[2]) for turn in turns)
