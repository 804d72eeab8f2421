"""Why a prediction would fail, from the numbers of a check: causes, and nothing that only follows from one."""

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.check.report import EpisodeCheck, PlanCheck
from app.pipeline.check.row_causes import row_cause
from app.pipeline.check.rule_causes import many_rows, missed_path, mixed_recordings, path_left, recorded_otherwise
from app.pipeline.findings import SEVERITIES, Finding
from app.pipeline.keyframes import KeyframeRule

FEW = 3  # demonstrations of an instruction, from which on an odd one stands out from the usual
ENOUGH = 4  # of one plan, to tell that one of them goes elsewhere
ELSEWHERE_M = 0.05
ELSEWHERE = 4.0  # times what most of the others are off
MOST = 0.8
COMMON = 1 / 2  # the share of an instruction's demonstrations that prompts show at least

Found = tuple[list[Finding], list[str]]


def find_causes(plans: Sequence[PlanCheck], rule: KeyframeRule) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    """The findings, the severest first, and the ids of the demonstrations that do not do as the others.

    Args:
        plans: those with most demonstrations first.
    """
    findings, unlike_ids = missed_path(plans, rule), []
    if not findings:
        for group in _by_instruction(plans):
            found, ids = _of_instruction(group, plans, rule)
            findings += found
            unlike_ids += ids
        findings += [finding for k, plan in enumerate(plans) for finding in path_left(plan, k, rule)]
    findings += [finding for k, plan in enumerate(plans) for finding in many_rows(plan, k)]
    for group in _by_instruction(plans):
        findings += [finding for alike in _by_gripper(group) for finding in mixed_recordings(_episodes(alike))]
        findings += _few(group)
    severest_first = sorted(findings, key=lambda finding: -SEVERITIES.index(finding.severity))
    return tuple(severest_first), tuple(unlike_ids)


def _by_instruction(plans: Sequence[PlanCheck]) -> list[list[PlanCheck]]:
    groups: dict[str, list[PlanCheck]] = defaultdict(list)
    for plan in plans:
        groups[plan.asks_for].append(plan)
    return list(groups.values())


def _by_gripper(group: Sequence[PlanCheck]) -> list[list[PlanCheck]]:
    """Plans of the same grasps and releases together."""
    alike: dict[tuple[bool, ...], list[PlanCheck]] = defaultdict(list)
    for plan in group:
        alike[plan.gripper].append(plan)
    return list(alike.values())


def _episodes(group: Sequence[PlanCheck]) -> list[EpisodeCheck]:
    return [episode for plan in group for episode in plan.episodes]


def _of_instruction(group: Sequence[PlanCheck], plans: Sequence[PlanCheck], rule: KeyframeRule) -> Found:
    """What is wrong with one instruction's rows; only of demonstrations that this does not explain, which are odd."""
    causes = {id(plan): row_cause(plan, plans.index(plan), rule) for plan in group}
    findings = list({cause.code: cause for cause in reversed(causes.values()) if cause is not None}.values())
    explained = {plan.gripper for plan in group if causes[id(plan)] is not None}
    odd, ids = _unlike([plan for plan in group if plan.gripper not in explained], group, rule)
    return findings + odd, ids


def _unlike(unexplained: Sequence[PlanCheck], group: Sequence[PlanCheck], rule: KeyframeRule) -> Found:
    number = len(_episodes(group))
    shown = sum(len(plan.episodes) for plan in group if plan.shown)
    if unexplained and number >= ENOUGH and shown <= COMMON * number:
        return [_no_common_plan(group, number, rule)], []
    findings, ids = [], []
    otherwise = [one for alike in _by_gripper(group) for one in recorded_otherwise(_episodes(alike))]
    for plan in unexplained:
        for episode, reason in _odd_ones(plan, group[0]):
            if episode in otherwise:
                continue
            ids.append(episode.id)
            findings.append(_unlike_others(episode, reason, number - 1))
    return findings, ids


def _odd_ones(plan: PlanCheck, usual: PlanCheck) -> Iterator[tuple[EpisodeCheck, str]]:
    """Episodes of a plan that prompts leave out, and those that go elsewhere in a row; with what is odd."""
    if not plan.shown:
        for episode in plan.episodes:
            yield episode, f"{_other_way(plan, usual)}, and prompts leave it out"
        return
    if len(plan.episodes) < ENOUGH:
        return
    off_m = np.array([[off.together_m for off in episode.errors] for episode in plan.episodes])
    for place, episode in enumerate(plan.episodes):
        most_m = np.quantile(np.delete(off_m, place, axis=0), MOST, axis=0)
        over = off_m[place] - np.maximum(ELSEWHERE_M, ELSEWHERE * most_m)
        if over.max(initial=0) > 0:
            row = int(np.argmax(over))
            off = episode.errors[row]
            yield episode, f"row {row + 1} is {100 * off.m:.1f} cm and {off.deg:.0f} degrees from where they predict it"


def _other_way(plan: PlanCheck, usual: PlanCheck) -> str:
    switches, usually = len(plan.gripper) - 1, len(usual.gripper) - 1
    if plan.gripper == usual.gripper:
        return "it goes another way"
    if switches == usually:
        return "it closes the gripper where they open it"
    return f"its gripper opens or closes {switches} times, theirs {usually} times"


def _unlike_others(episode: EpisodeCheck, reason: str, num_others: int) -> Finding:
    message = (
        f"Demonstration {episode.id} ({episode.instruction!r}) is unlike the {num_others} others: {reason}. Look at it,"
        " and delete it or record more of its kind."
    )
    worst_cm = {"worst_cm": round(100 * max(off.m for off in episode.errors), 2)} if episode.errors else {}
    where = f"episodes[{episode.id}]"
    return Finding("demonstration-unlike-others", "warning", message, where, {"others": num_others, **worst_cm})


def _no_common_plan(group: Sequence[PlanCheck], number: int, rule: KeyframeRule) -> Finding:
    remedy = "demonstrate it in one way, and send every object whose place decides between ways"
    if not rule.aligned:
        remedy = f"the rule {rule.rule!r} finds other keyframes in each; `auto` gives those of one plan equally many"
    message = (
        f"The {number} demonstrations of {group[0].episodes[0].instruction!r} are carried out in {len(group)} ways, and"
        f" no more than half of them in the usual one: {remedy}."
    )
    return Finding("no-common-plan", "warning", message, "plans", {"demonstrations": number, "plans": len(group)})


def _few(group: Sequence[PlanCheck]) -> list[Finding]:
    number = len(_episodes(group))
    if number >= FEW:
        return []
    instruction = group[0].episodes[0].instruction
    message = (
        f"{instruction!r} has {number} demonstration{'s' if number > 1 else ''}: record more, ten if possible, with the"
        " objects in other places. With fewer than three nobody can tell what a row follows, or which one is odd."
    )
    return [Finding("few-demonstrations", "info", message, "episodes", {"demonstrations": number})]
