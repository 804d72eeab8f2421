"""Demonstrations that do otherwise than the others, which overrule them.

Prompts leave out a rare plan, and move each row to where most demonstrations of its plan have it. Some act elsewhere,
some have two objects under each other's names, and some use the gripper otherwise.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby, permutations

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import Finding
from app.pipeline.findings.hand import NEVER_M, off_from_m
from app.pipeline.findings.rules import ELSEWHERE, EXCHANGED, LEFT_OUT
from app.pipeline.order.vocabulary import PLACE_WORDS
from app.pipeline.plans import RARE_SHARE
from app.pipeline.plans.agreement import TWO_WAYS_M
from app.pipeline.plans.rows import BEYOND_NOISE_M, WAY_SHARE, PlanRow, acting_rows
from app.pipeline.plans.support import Support
from roboprompt_client.types.poses import EndEffectorAction

SCATTERS = 2.0  # times the median scatter of a row, within which a demonstration does the same
LISTED = 3  # ids that a sentence names
SAME_M = BEYOND_NOISE_M / 2  # from where the usual plan would act: does the same
MIN_OTHERS = 3  # demonstrations that tell what is usual


def elsewhere_findings(
    alike: Sequence[Demonstration], off_m: Sequence[float], left_out: Sequence[bool], *, declared: bool
) -> Iterator[Finding]:
    """The demonstrations that the others overrule though they act elsewhere, in one finding.

    Where words say by its place which object is meant, and some act at another one, the place decides: what is
    overruled may be right, and a likeness of scenes that parts the plans is no reason.

    Args:
        alike: that ask for the same.
        off_m: of each, how far it acts from where the others of its plan do; of those that prompts leave out, from
            where the plans that are shown would.
        left_out: whether prompts leave it out. More than a third that act clearly elsewhere are another way.
        declared: whether the task says that there are several ways.
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
    listed = ", ".join(alike[k].id for k in elsewhere[:LISTED])
    more = f" and {len(elsewhere) - LISTED} more" if elsewhere[LISTED:] else ""
    message = (
        f"Of {len(alike)} demonstrations of {alike[0].instruction!r} {len(elsewhere)} act"
        f" {100 * (TWO_WAYS_M if is_way else BEYOND_NOISE_M):.0f} cm or more from where the others do: {listed}{more}."
        " The answer may not do what they do. Delete what was recorded wrongly; where a place decides which object is"
        " meant, name the object in the instruction."
    )
    value = 0.0 if declared else 1.0 if at_others else len(elsewhere) / len(alike)
    numbers = {"elsewhere": len(elsewhere), "demonstrations": len(alike)}
    yield ELSEWHERE.finding(message, "demonstrations", numbers, value=value)


def answer_findings(support: Support, asked: Query, actions: Sequence[EndEffectorAction]) -> Iterator[Finding]:
    """An answer that acts where no plan of a task does: the demonstrations that the prompt shows are odd ones.

    Args:
        support: of all demonstrations, where a prompt shows some.
        asked: a part of the instruction; the `actions` are of all parts.
    """
    off_m = from_shown_m(support, Demonstration(asked.instruction, asked.objects, tuple(actions), start=asked.start))
    if off_m > TWO_WAYS_M:
        message = (
            "The answer follows demonstrations that act, or use the gripper, otherwise than most of the task's: those"
            " that were chosen for the prompt are odd ones. Choose others, or delete what was recorded wrongly."
        )
        yield ELSEWHERE.finding(message, "actions", {"off_m": off_m}, value=1.0)


def from_shown_m(support: Support, other: Demonstration) -> float:
    """How far a demonstration stays from where the nearest of some plans would act in its scene, beyond their scatter.

    One that comes there by another way, or does more besides, does the same.
    """
    plans = support.alike(other.order)
    if any(len(group[0].order.clauses) != len(other.order.clauses) for group, _ in plans):
        return 0.0  # then it is not known which rows are asked for
    placed = support.placed(other) or ()
    both = zip((rows for _, rows in plans), placed, strict=False)
    acts = ([(plan[k].action, rows[k]) for k in acting_rows(rows)] for rows, plan in both)
    return min((_missed_m(acted, other) for acted in acts), default=0.0)


def _missed_m(acts: Sequence[tuple[EndEffectorAction, PlanRow]], demonstration: Demonstration) -> float:
    """How far it stays from the acts, done in their order with the gripper as it is then; of these the farthest."""
    best_m = np.zeros(len(demonstration.actions))  # of the acts until now, the last at this action or before it
    for act, row in acts:
        off_m = [off_from_m(act.position_m, act.gripper_open, action) for action in demonstration.actions]
        best_m = np.minimum.accumulate(np.maximum(best_m, np.array(off_m) - SCATTERS * row.scatter_m))
    return float(best_m[-1]) if len(best_m) else NEVER_M


def _at_other_objects(alike: Sequence[Demonstration]) -> list[int]:
    """Those that clearly act at another object than most; any is right where words have the usual one elsewhere."""
    away_m = [_away_by_role_m(demonstration) for demonstration in alike]
    nearest_m = [min(roles.values()) for roles in away_m]
    usual = Counter(min(roles, key=roles.__getitem__) for roles in away_m).most_common(1)[0][0]
    return [k for k, m in enumerate(nearest_m) if away_m[k].get(usual, m) > m + BEYOND_NOISE_M]


def _away_by_role_m(shown: Demonstration) -> dict[str, float]:
    """How far from each object the gripper first switches; without a switch, where the hand is lowest."""
    lowest = int(np.argmin([action.position_m[2] for action in shown.actions]))
    at_m = shown.actions[next(iter(shown.switches), lowest)].position_m
    return {role_of(shown, pose.name): float(np.linalg.norm(pose.position_m - at_m)) for pose in shown.objects}


def role_of(demonstration: Demonstration, name: str) -> str:
    """The object's place in the instruction, or its name."""
    mentioned = demonstration.order.objects
    return f"<{mentioned.index(name)}>" if name in mentioned else name


def exchanged_findings(alike: Sequence[Demonstration]) -> Iterator[Finding]:
    """The two objects whose exchange explains most of the demonstrations that act elsewhere than the usual plan.

    Their scenes differ with the names, so that plans seem to follow from the scenes. One object must be in the
    instruction, which says what to act on; where no word names either, a scene may well decide between them.

    Args:
        alike: that ask for the same.
    """
    kinds = Counter(demonstration.kind for demonstration in alike)
    usual = kinds.most_common(1)[0][0]
    if len(kinds) == 1 or not all(demonstration.actions for demonstration in alike):
        return
    support = Support.of([[item for item in alike if item.kind == usual]])
    others = [d for d in alike if d.kind != usual and from_shown_m(support, d) > BEYOND_NOISE_M]
    explained: Counter[tuple[str, str]] = Counter()
    for other in others:
        for one, second in permutations((pose.name for pose in other.objects), 2):
            if one in other.order.objects and from_shown_m(support, _exchanged(other, one, second)) < SAME_M:
                explained[one, second] += 1
    if not explained:
        return
    (one, second), number = explained.most_common(1)[0]
    share = number / len(alike)
    message = (
        f"{number} of {len(alike)} demonstrations of {alike[0].instruction!r} do what the others do if {one} and"
        f" {second} have each other's names there. Correct or delete those that are named wrongly."
    )
    yield from EXCHANGED.findings(share, message, "demonstrations", {"share": share})


def _exchanged(shown: Demonstration, one: str, other: str) -> Demonstration:
    names = {one: other, other: one}
    return replace(shown, objects=tuple(replace(p, name=names.get(p.name, p.name)) for p in shown.objects))


def unlike_findings(new: Demonstration, others: Sequence[Demonstration]) -> Iterator[Finding]:
    """Says so where its gripper opens and closes otherwise than in most demonstrations that ask for the same.

    Args:
        new, others: with the keyframes of their recordings.
    """
    ways = Counter(_way(shown) for shown in others if shown.order.form == new.order.form)
    if ways.total() < MIN_OTHERS:
        return
    own, (usual, number) = _way(new), ways.most_common(1)[0]
    ways[own] += 1
    if own != usual and ways[own] <= RARE_SHARE * ways.total():
        message = (
            f"The gripper switches {len(own) - 1} times, in {number} of the {ways.total() - 1} other demonstrations"
            f" {len(usual) - 1} times: prompts leave this one out, unless more are like it or its scene tells when to"
            " do so. Was something dropped, or grasped twice? Then delete it."
        )
        yield LEFT_OUT.finding(message, "trajectory.gripper_open", {"alike": ways[own], "demonstrations": ways.total()})


def _way(shown: Demonstration) -> tuple[bool, ...]:
    states = [state for state, _ in groupby(action.gripper_open for action in shown.actions)]
    return tuple(states if states[:1] == [True] else [True, *states])
