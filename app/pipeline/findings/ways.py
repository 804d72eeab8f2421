"""Demonstrations of one instruction that do it in several ways, where nothing tells which way to take."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import CONTRADICTING, SEVERAL_WAYS
from app.pipeline.plans import Group, usual_ways, words_decide
from app.pipeline.plans.agreement import two_ways
from app.pipeline.plans.by_scene import parting
from app.pipeline.plans.rows import acting_rows, plan_rows
from roboprompt_client.types import quaternions
from roboprompt_client.types.poses import EndEffectorAction

IN_PLACE_M = 0.03  # a hand that goes less far only turns
TWISTS_DEG = 60.0  # between two ways: they turn what they hold otherwise; right demonstrations differ by up to 9


def ways_findings(
    alike: Sequence[Demonstration], round_objects: frozenset[str], *, declared: bool
) -> Iterator[Finding]:
    """Demonstrations of one instruction that go several ways, where neither words nor scene tell which.

    A fault of half of the recordings looks like this: another base frame, an inverted gripper. That neighboring scenes
    have the same plan is often chance; `parting` tells by how much.

    Args:
        alike: that ask for the same.
        round_objects: whose yaw the task says means nothing, or little: a hand turned otherwise does the same there.
        declared: whether the task says that there are several ways.
    """
    decided = words_decide(alike) or parting(alike) is not None
    ways = [] if decided else _acting_otherwise(usual_ways(alike), round_objects)
    if len(ways) < 2:
        return
    numbers = " and ".join(str(len(way)) for way in ways)
    message = (
        f"{numbers} demonstrations of {alike[0].instruction!r} do it in different ways, and neither words nor scene"
        " tell which to take."
    )
    if not declared:
        message += (
            " Were some recorded with another base frame or an inverted gripper? Delete what is wrong; where all are"
            ' right, set the task\'s "ways" to "several".'
        )
    yield SEVERAL_WAYS.finding(message, "demonstrations", {"num_ways": len(ways)}, value=0.0 if declared else 1.0)


def _acting_otherwise(ways: Sequence[Group], round_objects: frozenset[str]) -> list[Group]:
    """The ways, of those that differ only in how the hand gets there one: they are together one way."""
    found: list[Group] = []
    for way in ways:
        same = next((k for k, other in enumerate(found) if _act_alike(other, way, round_objects)), None)
        if same is None:
            found.append(way)
        else:
            found[same] += way
    return found


def _act_alike(one: Group, other: Group, round_objects: frozenset[str]) -> bool:
    if abs(_twist_deg(one) - _twist_deg(other)) > TWISTS_DEG:
        return False
    both = [*_acting(one), *_acting(other)]
    if len({tuple(action.gripper_open for action in demonstration.actions) for demonstration in both}) > 1:
        return False
    rows = (row.unturned if row.anchors[0].object_name in round_objects else row for row in plan_rows(both))
    return all(two_ways(row) is None and CONTRADICTING.severity(row.way_off_m) is None for row in rows)


def _acting(way: Group) -> list[Demonstration]:
    """The way with the actions alone in which the hand acts: ways have rows of their own, and may have more."""
    acting = acting_rows(plan_rows(way))
    return [replace(shown, actions=tuple(shown.actions[k] for k in acting)) for shown in way]


def _twist_deg(group: Group) -> float:
    """How far the closed hand turns about the vertical without leaving its place, as it turns a tap: the median."""
    return float(np.degrees(np.median([_twist_rad(demonstration.actions) for demonstration in group])))


def _twist_rad(actions: Sequence[EndEffectorAction]) -> float:
    turns = [
        quaternions.product(then.quaternion_xyzw, quaternions.inverse(first.quaternion_xyzw))
        for first, then in pairwise(actions)
        if not first.gripper_open and np.linalg.norm(then.position_m - first.position_m) < IN_PLACE_M
    ]
    return sum(float(quaternions.to_rotation_vector(turn)[2]) for turn in turns)
