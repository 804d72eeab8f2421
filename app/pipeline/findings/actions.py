"""Findings about actions; those with one cause are one finding.

The size of objects is unknown, so that the least demonstrated distance from an object stands for the safe one.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from app.pipeline.episode import Query
from app.pipeline.errors import UnsupportedActionError
from app.pipeline.findings import Finding
from app.pipeline.findings.demonstrated_scenes import ShownScenes, distances_m, path_m
from app.pipeline.findings.places import MIN_DEMONSTRATIONS
from app.pipeline.findings.rules import PASSES_CLOSE, STRAYING_ACTION, UNSUPPORTED
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

MAX_LISTED = 4  # numbers of actions that a message lists
NEARER, NEARER_M = 0.5, 0.03  # reported below this share of the least demonstrated distance, and if nearer by this


@dataclass(frozen=True)
class ActionDoubt:
    """An action outside of the demonstrated range.

    Attributes:
        index: of the action, from 0.
        off_m, off_deg: how far it is beyond the farthest demonstration.
        seen_from: what it follows, in words.
        unsupported: the reason for refusing it, unless the request allows it; None if it is within the margin.
    """

    index: int
    off_m: float = 0.0
    off_deg: float = 0.0
    seen_from: str = ""
    unsupported: UnsupportedActionError | None = None


def action_findings(doubts: Sequence[ActionDoubt]) -> tuple[Finding, ...]:
    """Return at most one finding for the unsupported actions and one for those within the margin."""
    unsupported = [doubt for doubt in doubts if doubt.unsupported is not None]
    straying = [doubt for doubt in doubts if doubt.unsupported is None]
    found = []
    if unsupported:
        message = f"{unsupported[0].unsupported}."
        if len(unsupported) > 1:
            message = f"{_named(unsupported)} are outside of the demonstrated range. The first: {message}"
        numbers: dict[str, float] = {"num_actions": len(unsupported)}
        found.append(UNSUPPORTED.finding(message, f"actions[{unsupported[0].index}]", numbers))
    if straying:
        off_deg, worst = max(doubt.off_deg for doubt in straying), max(straying, key=lambda doubt: doubt.off_m)
        message = (
            f"{_named(straying)} {'is' if len(straying) == 1 else 'are'} up to {100 * worst.off_m:.1f} cm and"
            f" {off_deg:.0f} degrees outside of the demonstrated range, relative to {worst.seen_from}."
        )
        numbers = {"num_actions": len(straying), "off_m": worst.off_m, "off_deg": off_deg}
        found.append(STRAYING_ACTION.finding(message, f"actions[{straying[0].index}]", numbers))
    return tuple(found)


def _named(doubts: Sequence[ActionDoubt]) -> str:
    numbers = [str(doubt.index + 1) for doubt in doubts]
    if len(numbers) == 1:
        return f"Action {numbers[0]}"
    if len(numbers) > MAX_LISTED:
        return f"Actions {', '.join(numbers[:MAX_LISTED])} and {len(numbers) - MAX_LISTED} more"
    return f"Actions {', '.join(numbers[:-1])} and {numbers[-1]}"


def passing_findings(
    query: Query, actions: Sequence[EndEffectorAction], shown: ShownScenes, bystanders: Sequence[ObjectPose] = ()
) -> Iterator[Finding]:
    """Yield a finding for each object that the hand passes much nearer than in any demonstration.

    Args:
        query: the observed objects, and where the hand is before the first action, if that is known.
        bystanders: objects that the demonstrations did not have.
    """
    if len(shown.demonstrations) < MIN_DEMONSTRATIONS or not actions:
        return
    hand_m = path_m(query.start, actions)
    kept_m = [(pose, shown.passed_m.get(query.order.placeholder(pose.name))) for pose in query.objects]
    for pose, least_m in (*kept_m, *((pose, math.inf) for pose in bystanders)):
        all_m = distances_m(hand_m, pose.position_m)
        near_m = float(all_m.min())
        if least_m is None or near_m > min(PASSES_CLOSE.levels["warning"], NEARER * least_m, least_m - NEARER_M):
            continue
        number = max(0, int(all_m.argmin()) - (query.start is not None))
        is_new = math.isinf(least_m)
        kept = "demonstrations do not have it" if is_new else f"demonstrations kept at least {100 * least_m:.1f} cm"
        message = (
            f"On the way to action {number + 1} the hand passes {100 * near_m:.1f} cm from the center of {pose.name!r};"
            f" {kept}. The hand or the held object may hit it: move it away, or demonstrate a path around it."
        )
        numbers = {"distance_m": near_m, "action": number, **({} if is_new else {"demonstrated_m": least_m})}
        yield PASSES_CLOSE.finding(message, f"objects[{pose.name}]", numbers, value=near_m)
