"""Findings about why demonstrations predict each other badly, without those that only follow from another.

A row cannot be predicted if it depends on an unknown object, or if the pose of its object is noisy.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from operator import attrgetter

import numpy as np

from app.pipeline.check.report import EpisodeCheck, Off, PlanCheck, RowCheck
from app.pipeline.check.settings import many_rows, missed_path, path_left, recorded_otherwise
from app.pipeline.findings import Finding
from app.pipeline.groups import grouped
from app.pipeline.keyframes import KeyframeRule
from app.pipeline.thresholds import BEYOND_NOISE_M
from roboprompt_client.types.severity import SEVERITIES

MIN_JUDGED = 3  # demonstrations of a plan from which its rows are judged
UNEXPLAINED_M = 0.06  # rotation included
UNEXPLAINED_DEG = 40.0
UNEXPLAINED_SHARE = 0.8  # of a row's variation: if as much remains, the row follows no known object
NOISY_M = 0.02
MIN_PER_INSTRUCTION = 3  # demonstrations of an instruction, fewer of which show no outlier
MIN_COMPARED = 4  # demonstrations of a plan, fewer of which show no outlier in a row
ELSEWHERE_M, ELSEWHERE_FACTOR = 0.05, 4.0  # the error of an outlier: at least this, and so many times that of others
OTHERS_SHARE = 0.8  # the quantile of the others' errors that it is compared with
COMMON_SHARE = 1 / 2  # of an instruction's demonstrations: if prompts show no more, there is no common plan

Causes = tuple[list[Finding], list[str]]


def row_cause(plan: PlanCheck, number: int, rule: KeyframeRule) -> Finding | None:
    """Return why rows of a plan scatter: noise affects all rows of an object, a missing object only some.

    Args:
        number: of the plan, in `where` of the finding.
    """
    if len(plan.episodes) < MIN_JUDGED:
        return None
    unexplained = _unexplained(plan, rule)
    explained = [row for k, row in enumerate(plan.rows) if k not in unexplained]
    closest = _closest(explained)
    noisiest = max(closest, key=lambda name: closest[name].m, default="")
    least_m = NOISY_M if len(explained) > len(unexplained) else BEYOND_NOISE_M
    if noisiest and closest[noisiest].m >= least_m:
        return _scatters(noisiest, closest[noisiest], number)
    return _follows_no_object(plan, unexplained, number) if unexplained else None


def _unexplained(plan: PlanCheck, rule: KeyframeRule) -> Sequence[int]:
    """Return the numbers of the rows that follow no known object, though their place matters.

    People approach and leave by any path, and may close an empty hand on the way. In recordings without rests, a switch
    of the gripper matters if the next row follows nothing either, and without a switch the last row matters.
    """
    lost = [k for k, row in enumerate(plan.rows) if _follows_nothing(row)]
    if rule.rule not in ("waypoints", "uniform") and all(episode.manner == "rests" for episode in plan.episodes):
        return lost
    last = len(plan.rows) - 1
    switches = [k for k, row in enumerate(plan.rows) if row.switches] or [last]
    return [k for k in lost if k in switches and (k == last or k + 1 in lost)]


def _follows_nothing(row: RowCheck) -> bool:
    if row.error is None:
        return False
    lost = min(row.error.together_m, row.varies.together_m) >= UNEXPLAINED_M
    turned = min(row.error.deg, row.varies.deg) >= UNEXPLAINED_DEG
    return (lost and row.error.together_m >= UNEXPLAINED_SHARE * row.varies.together_m) or (
        turned and row.error.deg >= UNEXPLAINED_SHARE * row.varies.deg
    )


def _closest(rows: Sequence[RowCheck]) -> dict[str, Off]:
    """Return by object the error of the row that varies least around it."""
    following: dict[str, list[Off]] = defaultdict(list)
    for row in rows:
        if row.objects and row.error is not None:
            following[", ".join(row.objects)].append(row.error)
    return {name: min(found, key=lambda off: off.m) for name, found in following.items()}


def _scatters(name: str, error: Off, number: int) -> Finding:
    scatter = {"scatter_cm": round(100 * error.m, 2)}
    if error.m >= BEYOND_NOISE_M:
        message = (
            f"Around {name} demonstrations differ from each other by at least {100 * error.m:.1f} cm in every row,"
            " which is too much for noise. They use different objects, or another order. Demonstrate the task in one"
            " way, or name in the instruction what decides."
        )
        return Finding("no-common-plan", "warning", message, f"plans[{number}]", scatter)
    message = (
        f"Around {name} the hand scatters by at least {100 * error.m:.1f} cm and {error.deg:.0f} degrees in every row."
        " Either poses are noisy or the motion is loose. Check the camera's calibration and the estimator, and record"
        " more demonstrations: prompts show their mean."
    )
    numbers = {**scatter, "scatter_deg": round(error.deg, 1)}
    return Finding("noisy-poses", "warning", message, f"plans[{number}]", numbers)


def _follows_no_object(plan: PlanCheck, places: Sequence[int], number: int) -> Finding:
    lost = [(row.error, row.varies) for row in (plan.rows[k] for k in places) if row.error is not None]
    error, varies = max(lost, key=lambda item: item[0].together_m)
    known = ", ".join(dict.fromkeys(name for row in plan.rows for name in row.objects)) or "none"
    which = f"Row {places[0] + 1}" if len(places) == 1 else f"Rows {', '.join(str(k + 1) for k in places)}"
    message = (
        f"{which} of {plan.episodes[0].instruction!r} vary by {100 * varies.m:.1f} cm and {varies.deg:.0f} degrees and"
        f" follow no known object: the others predict them with an error of {100 * error.m:.1f} cm and"
        f" {error.deg:.0f} degrees. Send the object that decides where the hand goes. Other rows follow: {known}."
    )
    error_cm, varies_cm = round(100 * error.m, 2), round(100 * varies.m, 2)
    numbers = {"error_cm": error_cm, "varies_cm": varies_cm, "rows": len(places)}
    return Finding("row-follows-no-object", "danger", message, f"plans[{number}].rows[{places[0]}]", numbers)


def find_causes(plans: Sequence[PlanCheck], rule: KeyframeRule) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    """Return the findings, severest first, and the ids of outlier demonstrations.

    Args:
        plans: those with most demonstrations first.
    """
    missed = missed_path(plans, rule)
    findings, unlike_ids = [*missed], []
    by_instruction = grouped(plans, attrgetter("asks_for")).values()
    for group in () if missed else by_instruction:
        found, ids = _of_instruction(group, plans, rule)
        findings += found
        unlike_ids += ids
    for k, plan in enumerate(plans):
        findings += [] if missed else path_left(plan, k, rule)
        findings += many_rows(plan, k)
    findings += [finding for group in by_instruction for finding in _few(group)]
    severest_first = sorted(findings, key=lambda finding: -SEVERITIES.index(finding.severity))
    return tuple(severest_first), tuple(unlike_ids)


def _episodes(group: Sequence[PlanCheck]) -> list[EpisodeCheck]:
    return [episode for plan in group for episode in plan.episodes]


def _of_instruction(group: Sequence[PlanCheck], plans: Sequence[PlanCheck], rule: KeyframeRule) -> Causes:
    causes = {plan: row_cause(plan, plans.index(plan), rule) for plan in group}
    findings = list({cause.code: cause for cause in reversed(causes.values()) if cause is not None}.values())
    explained = {plan.gripper for plan in group if causes[plan] is not None}
    odd, ids = _unlike([plan for plan in group if plan.gripper not in explained], group, rule)
    return findings + odd, ids


def _unlike(unexplained: Sequence[PlanCheck], group: Sequence[PlanCheck], rule: KeyframeRule) -> Causes:
    number = len(_episodes(group))
    shown = sum(len(plan.episodes) for plan in group if plan.shown)
    if unexplained and number >= MIN_COMPARED and shown <= COMMON_SHARE * number:
        return [_no_common_plan(group, number, rule)], []
    findings, ids = [], []
    otherwise = [
        one for alike in grouped(group, attrgetter("gripper")).values() for one in recorded_otherwise(_episodes(alike))
    ]
    for plan in unexplained:
        for episode, reason in _odd_ones(plan, group[0]):
            if episode in otherwise:
                continue
            ids.append(episode.id)
            findings.append(_unlike_others(episode, reason, number - 1))
    return findings, ids


def _odd_ones(plan: PlanCheck, usual: PlanCheck) -> Iterator[tuple[EpisodeCheck, str]]:
    """Yield the episodes that prompts leave out, or that are outliers in a row, each with the reason."""
    if not plan.shown:
        for episode in plan.episodes:
            yield episode, f"{_other_way(plan, usual)}, and prompts leave it out"
        return
    if len(plan.episodes) < MIN_COMPARED:
        return
    off_m = np.array([[off.together_m for off in episode.errors] for episode in plan.episodes])
    for place, episode in enumerate(plan.episodes):
        most_m = np.quantile(np.delete(off_m, place, axis=0), OTHERS_SHARE, axis=0)
        over = off_m[place] - np.maximum(ELSEWHERE_M, ELSEWHERE_FACTOR * most_m)
        if over.max(initial=0) > 0:
            row = int(np.argmax(over))
            off = episode.errors[row]
            yield episode, f"row {row + 1} is {100 * off.m:.1f} cm and {off.deg:.0f} degrees off their prediction"


def _other_way(plan: PlanCheck, usual: PlanCheck) -> str:
    switches, usually = len(plan.gripper) - 1, len(usual.gripper) - 1
    if plan.gripper == usual.gripper:
        return "it takes another path"
    if switches == usually:
        return "it closes the gripper where they open it"
    return f"its gripper switches {switches} times, theirs {usually} times"


def _unlike_others(episode: EpisodeCheck, reason: str, num_others: int) -> Finding:
    message = (
        f"Demonstration {episode.id} ({episode.instruction!r}) is unlike the {num_others} others: {reason}. Replay it;"
        " delete it if it is wrong, or record more like it."
    )
    worst_cm = {"worst_cm": round(100 * max(off.m for off in episode.errors), 2)} if episode.errors else {}
    where = f"episodes[{episode.id}]"
    return Finding("demonstration-unlike-others", "warning", message, where, {"others": num_others, **worst_cm})


def _no_common_plan(group: Sequence[PlanCheck], number: int, rule: KeyframeRule) -> Finding:
    remedy = "Demonstrate it in one way, and send every object whose place decides between ways"
    if not rule.aligned:
        remedy = f"The rule {rule.rule!r} finds different keyframes in each; use `auto`, which aligns them"
    message = (
        f"The {number} demonstrations of {group[0].episodes[0].instruction!r} use {len(group)} plans, none of them in"
        f" more than half. {remedy}."
    )
    return Finding("no-common-plan", "warning", message, "plans", {"demonstrations": number, "plans": len(group)})


def _few(group: Sequence[PlanCheck]) -> list[Finding]:
    number = len(_episodes(group))
    if number >= MIN_PER_INSTRUCTION:
        return []
    instruction = group[0].episodes[0].instruction
    message = (
        f"{instruction!r} has {number} demonstration{'s' if number > 1 else ''}. Record more, ten if possible, with the"
        " objects in other places: fewer than three do not show what a row follows, nor an outlier."
    )
    return [Finding("few-demonstrations", "info", message, "episodes", {"demonstrations": number})]
