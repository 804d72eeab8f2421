"""Outlier demonstrations: they act elsewhere, exchange names, or use the gripper differently.

A prompt leaves out a rare plan and shows the robust center of each row, so that the answer does not follow them.
"""

import math
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby, permutations

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import Finding
from app.pipeline.findings.path_kept import NEVER_M, off_from_m
from app.pipeline.findings.rules import ACTS_ELSEWHERE, LEFT_OUT, NAMES_EXCHANGED, NOT_SHOWN
from app.pipeline.order.vocabulary import PLACE_WORDS
from app.pipeline.plans.acting import acting_rows, touching_rows
from app.pipeline.plans.rows import PlanRow
from app.pipeline.plans.support import PlacedPlan, Support
from app.pipeline.plans.turn import half_turned
from app.pipeline.plans.ways import TWO_WAYS_M
from app.pipeline.thresholds import BEYOND_NOISE_M, M_PER_RAD, RARE_SHARE, WAY_SHARE
from roboprompt_client.types import quaternions
from roboprompt_client.types.poses import EndEffectorAction

SCATTERS = 2.0  # within so many times a row's median scatter, a demonstration acts at the same place
MAX_LISTED = 3  # ids that a message names
MIN_OTHERS = 3  # demonstrations from which the usual use of the gripper is known
ALIKE_M = BEYOND_NOISE_M / 2  # within this of where the usual plan would act, a demonstration does the same


def elsewhere_findings(
    alike: Sequence[Demonstration], off_m: Sequence[float], left_out: Sequence[bool], *, declared: bool
) -> Iterator[Finding]:
    """Yield at most one finding for the demonstrations that act elsewhere than the others.

    Where the instruction selects an object by its place ("left") and some demonstrations act at another object, these
    may be right, whether or not the scenes differ.

    Args:
        alike: demonstrations that ask for the same.
        off_m: of each, the distance from where the others of its plan act; of those that prompts leave out, from where
            the plans in the prompt would act.
        left_out: whether prompts leave it out; more than a third that act clearly elsewhere are another way.
        declared: whether the task's setting `ways` is `several`.
    """
    by_place = not PLACE_WORDS.isdisjoint(alike[0].order.form.split())
    compared = all(demonstration.actions and demonstration.objects for demonstration in alike)
    others = {k for k, far_m in enumerate(off_m) if left_out[k] and far_m > TWO_WAYS_M}
    is_way = len(others) > WAY_SHARE * len(alike)
    found = {k for k, far_m in enumerate(off_m) if far_m > BEYOND_NOISE_M}.union(others if is_way else ())
    at_others = _at_other_objects(alike) if by_place and compared else []
    elsewhere = sorted(found.union(at_others))
    if not elsewhere:
        return
    listed = ", ".join(alike[k].id for k in elsewhere[:MAX_LISTED])
    more = f" and {len(elsewhere) - MAX_LISTED} more" if elsewhere[MAX_LISTED:] else ""
    message = (
        f"{len(elsewhere)} of {len(alike)} demonstrations of {alike[0].instruction!r} act"
        f" {100 * (TWO_WAYS_M if is_way else BEYOND_NOISE_M):.0f} cm or more from where the others do: {listed}{more}."
        " The answer may not follow them. Delete those that are wrong; if the place decides which object is meant, name"
        " the object in the instruction."
    )
    value = 0.0 if declared else 1.0 if at_others else len(elsewhere) / len(alike)
    numbers = {"elsewhere": len(elsewhere), "demonstrations": len(alike)}
    yield ACTS_ELSEWHERE.finding(message, "demonstrations", numbers, value=value)


def exchanged_findings(alike: Sequence[Demonstration]) -> Iterator[Finding]:
    """Yield a finding if demonstrations (`alike`) would act where the usual plan acts if two names were exchanged back.

    The instruction must name one of the two objects; otherwise the scene may decide between them.
    """
    kinds = Counter(demonstration.kind for demonstration in alike)
    usual = kinds.most_common(1)[0][0]
    if len(kinds) == 1 or not all(demonstration.actions for demonstration in alike):
        return
    support = Support.of([[item for item in alike if item.kind == usual]])
    unlike = [item for item in alike if item.kind != usual and off_plans_m(support, item) > BEYOND_NOISE_M]
    explained = Counter(names for item in unlike for names in _explaining_names(support, item))
    if not explained:
        return
    (one, other), number = explained.most_common(1)[0]
    share = number / len(alike)
    message = (
        f"In {number} of {len(alike)} demonstrations of {alike[0].instruction!r} the names of {one} and {other} seem"
        " to be exchanged: with them exchanged back, the hand acts as in the others. Correct or delete these."
    )
    yield from NAMES_EXCHANGED.findings(share, message, "demonstrations", share=share)


def _explaining_names(support: Support, shown: Demonstration) -> Iterator[tuple[str, str]]:
    """Yield the pairs of names whose exchange makes the demonstration act as the plan does."""
    for one, other in permutations((pose.name for pose in shown.objects), 2):
        if one in shown.order.objects and off_plans_m(support, _with_exchanged(shown, one, other)) < ALIKE_M:
            yield one, other


def _with_exchanged(shown: Demonstration, one: str, other: str) -> Demonstration:
    names = {one: other, other: one}
    return replace(shown, objects=tuple(replace(pose, name=names.get(pose.name, pose.name)) for pose in shown.objects))


def answer_findings(
    support: Support, asked: Query, actions: Sequence[EndEffectorAction], round_objects: Container[str] | None
) -> Iterator[Finding]:
    """Yield a finding if an answer does what no plan of the task does, because the prompt shows only outliers.

    Args:
        support: the plans of all demonstrations of the task.
        asked: one part of the instruction.
        actions: the answer to all parts.
        round_objects: None where the answer is to several parts, of which only places are compared.
    """
    off_m = _answer_off_m(support, asked, actions, round_objects)
    message = (
        f"The answer {_difference(off_m)} most demonstrations of the task, as the few in the prompt do. Raise"
        " num_demonstrations, choose other demonstrations, or delete the wrong ones."
    )
    if off_m > TWO_WAYS_M:
        yield ACTS_ELSEWHERE.finding(message, "actions", {"off_m": off_m}, value=1.0)


def prompt_findings(
    support: Support, asked: Query, plans: Sequence[PlacedPlan], round_objects: Container[str]
) -> Iterator[Finding]:
    """Yield a finding if a prompt's demonstrations imply other actions in this scene than all of the task's.

    Few demonstrations may not show which axes and objects a row follows.

    Args:
        support: the plans of all demonstrations of the task.
        plans: those of the prompt's demonstrations, placed in the scene of `asked`.
    """
    answers = [[row.action for row in plan] for plan in plans]
    off_m = min((_answer_off_m(support, asked, answer, round_objects) for answer in answers), default=0.0)
    message = (
        f"The motion of the prompt's demonstrations {_difference(off_m)} all demonstrations of the task: the prompt has"
        " too few demonstrations to show what the hand follows. Raise num_demonstrations."
    )
    yield from NOT_SHOWN.findings(off_m, message, "demonstrations", off_m=off_m)


def _difference(off_m: float) -> str:
    if off_m >= NEVER_M:
        return "switches the gripper differently from"
    return f"acts {100 * off_m:.1f} cm (10 degrees of rotation count as 1 cm) from where the hand acts in"


def _answer_off_m(
    support: Support, asked: Query, actions: Sequence[EndEffectorAction], round_objects: Container[str] | None
) -> float:
    """Return how far an answer acts from the nearest plan; a gripper that is half turned throughout grasps alike."""
    answer = Demonstration(asked.instruction, asked.objects, tuple(actions), start=asked.start)
    off_m = off_plans_m(support, answer, round_objects)
    if off_m <= ALIKE_M:
        return off_m
    turned = replace(answer, actions=tuple(map(half_turned, actions)))
    return min(off_m, off_plans_m(support, turned, round_objects))


def off_plans_m(support: Support, other: Demonstration, round_objects: Container[str] | None = None) -> float:
    """Return how far a demonstration is from where the nearest plan would act in its scene, less the plan's scatter.

    A demonstration that gets there on another path has distance 0, and so has one that does more besides.

    Args:
        round_objects: if not None, the gripper must switch as often as in the plan, the end counts if the hand takes
            something last, and so do rotations of the hand (10 degrees as 1 cm), but for those at these objects.
    """
    plans = support.alike(other.order)
    if any(len(group[0].order.clauses) != len(other.order.clauses) for group, _ in plans):
        return 0.0  # which rows the instruction asks for is then unknown
    placed = support.placed(other) or ()
    found_m = []
    for (_, rows), plan in zip(plans, placed, strict=False):
        acting = [(plan[k].action, rows[k]) for k in acting_rows(rows)]
        if round_objects is None:
            found_m.append(_acts_off_m(acting, other))
        elif _states(row.gripper_open for row in rows) == _way(other):
            last = touching_rows(rows)[-1]
            takes = last > 0 and rows[last - 1].gripper_open and not rows[last].gripper_open
            acting += [(plan[-1].action, rows[-1])] if takes else []
            found_m.append(_acts_off_m(acting, other, round_objects))
        else:
            found_m.append(NEVER_M)
    return min(found_m, default=0.0)


def _acts_off_m(
    acts: Sequence[tuple[EndEffectorAction, PlanRow]],
    demonstration: Demonstration,
    round_objects: Container[str] | None = None,
) -> float:
    """Return the largest distance of an act from the nearest action with the same gripper state, in their order."""
    hands = np.array([action.quaternion_xyzw for action in demonstration.actions])
    best_m = np.zeros(len(demonstration.actions))  # for the acts so far, the last one at this action or earlier
    for act, row in acts:
        off_m = np.array([off_from_m(act.position_m, act.gripper_open, action) for action in demonstration.actions])
        off_m = off_m - SCATTERS * row.scatter_m
        if round_objects is not None and row.anchors[0].object_name not in round_objects:
            within_rad = math.radians(SCATTERS * float(np.median(row.off_deg)))
            turned_rad = quaternions.angles_rad(hands, act.quaternion_xyzw) - within_rad
            off_m = np.maximum(off_m, M_PER_RAD * turned_rad)
        best_m = np.minimum.accumulate(np.maximum(best_m, off_m))
    return float(best_m[-1]) if len(best_m) else NEVER_M


def _at_other_objects(alike: Sequence[Demonstration]) -> list[int]:
    away_m = [_distances_by_role_m(demonstration) for demonstration in alike]
    nearest_m = [min(roles.values()) for roles in away_m]
    usual = Counter(min(roles, key=roles.__getitem__) for roles in away_m).most_common(1)[0][0]
    return [k for k, m in enumerate(nearest_m) if away_m[k].get(usual, m) > m + BEYOND_NOISE_M]


def _distances_by_role_m(shown: Demonstration) -> dict[str, float]:
    """Return by role the distance of each object from the first gripper switch, or from the lowest action."""
    lowest = int(np.argmin([action.position_m[2] for action in shown.actions]))
    at_m = shown.actions[next(iter(shown.switches), lowest)].position_m
    return {shown.order.placeholder(pose.name): float(np.linalg.norm(pose.position_m - at_m)) for pose in shown.objects}


def gripper_outlier_findings(new: Demonstration, others: Sequence[Demonstration]) -> Iterator[Finding]:
    """Yield a finding if a new demonstration's gripper switches differently than in most with the same instruction."""
    ways = Counter(_way(shown) for shown in others if shown.order.form == new.order.form)
    if ways.total() < MIN_OTHERS:
        return
    own, (usual, number) = _way(new), ways.most_common(1)[0]
    ways[own] += 1
    if own != usual and ways[own] <= RARE_SHARE * ways.total():
        message = (
            f"The gripper switches {len(own) - 1} times here, and {len(usual) - 1} times in {number} of the"
            f" {ways.total() - 1} other demonstrations. Prompts leave this one out, unless more are like it or its"
            " scene explains the difference. If something was dropped or grasped twice, delete it."
        )
        yield LEFT_OUT.finding(message, "trajectory.gripper_open", {"alike": ways[own], "demonstrations": ways.total()})


def _way(shown: Demonstration) -> tuple[bool, ...]:
    return _states(action.gripper_open for action in shown.actions)


def _states(are_open: Iterable[bool]) -> tuple[bool, ...]:
    states = [state for state, _ in groupby(are_open)]
    return tuple(states if states[:1] == [True] else [True, *states])
