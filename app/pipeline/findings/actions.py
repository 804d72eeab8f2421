"""What is doubtful about actions, and about the demonstrations that a prompt shows.

Rows whose doubts share a cause are one finding. Demonstrations are doubted as far as they bear on the scene at hand.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from app.pipeline.errors import UnsupportedActionError
from app.pipeline.findings import Finding, Severity
from app.pipeline.plans.rows import BEYOND_NOISE_M, acting_rows
from app.pipeline.plans.support import PlacedPlan

MAX_LISTED = 4  # numbers of actions that a sentence lists
SCATTER_M = 0.01
CENTRE_OFF_M = 0.012  # as much as pose estimators err without harm; measured: docs/results/findings.md


@dataclass(frozen=True)
class ActionDoubt:
    """An action that is not where demonstrations have it.

    Attributes:
        index: of the action, from 0.
        off_m, off_deg: how far it lies beyond the farthest demonstration.
        seen_from: what it is relative to.
        unsupported: why it is so far off that it is refused unless the request lets it pass; None if it is not.
    """

    index: int
    off_m: float = 0.0
    off_deg: float = 0.0
    seen_from: str = ""
    unsupported: UnsupportedActionError | None = None


def action_findings(doubts: Sequence[ActionDoubt]) -> tuple[Finding, ...]:
    """At most one finding for all actions that demonstrations do not support, and one for those that stray."""
    unsupported = [doubt for doubt in doubts if doubt.unsupported is not None]
    straying = [doubt for doubt in doubts if doubt.unsupported is None]
    return (*_unsupported(unsupported), *_straying(straying))


def _unsupported(doubts: Sequence[ActionDoubt]) -> tuple[Finding, ...]:
    if not doubts:
        return ()
    first = doubts[0].unsupported
    message = f"{first}."
    if len(doubts) > 1:
        message = f"{_named(doubts)} are unlike the demonstrations; the first: {first}."
    numbers = {"num_actions": len(doubts)}
    return (Finding("unsupported-action", "danger", message, f"actions[{doubts[0].index}]", numbers),)


def _straying(doubts: Sequence[ActionDoubt]) -> tuple[Finding, ...]:
    if not doubts:
        return ()
    off_m, off_deg = max(doubt.off_m for doubt in doubts), max(doubt.off_deg for doubt in doubts)
    worst = max(doubts, key=lambda doubt: doubt.off_m)
    message = (
        f"{_named(doubts)} {'lies' if len(doubts) == 1 else 'lie'} up to {100 * off_m:.1f} cm and {off_deg:.0f} degrees"
        f" beyond where the demonstrations have them, seen from {worst.seen_from}."
    )
    numbers = {"num_actions": len(doubts), "off_m": off_m, "off_deg": off_deg}
    return (Finding("straying-action", "info", message, f"actions[{doubts[0].index}]", numbers),)


def _named(doubts: Sequence[ActionDoubt]) -> str:
    numbers = [str(doubt.index + 1) for doubt in doubts]
    if len(numbers) == 1:
        return f"Action {numbers[0]}"
    if len(numbers) > MAX_LISTED:
        return f"Actions {', '.join(numbers[:MAX_LISTED])} and {len(numbers) - MAX_LISTED} more"
    return f"Actions {', '.join(numbers[:-1])} and {numbers[-1]}"


def scatter_findings(plans: Sequence[PlacedPlan]) -> Iterator[Finding]:
    """Where the gripper acts, demonstrations that scatter say that poses are noisy or an object is missing.

    Prompts show the demonstrations' centre, so that what counts is how far that is likely to be off; beyond all noise
    they show no centre, and the number of demonstrations makes up for nothing.
    """
    acting = [(k, plan[k]) for plan in plans for k in acting_rows(plan)]
    scattered = [item for item in acting if item[1].scatter_m > SCATTER_M]
    if not scattered:
        return
    k, row = max(scattered, key=lambda item: (item[1].scatter_m > BEYOND_NOISE_M, item[1].centre_off_m))
    severity: Severity = "warning" if row.centre_off_m > CENTRE_OFF_M else "info"
    cause = "poses are noisy, or what it follows is not among the objects."
    if row.scatter_m > BEYOND_NOISE_M:
        severity = "danger"
        cause = "no noise does that. They do it in several ways, or what it follows is not among the objects."
    seen_from = row.anchor.object_name or row.anchor.frame
    message = (
        f"{row.number} demonstrations scatter by {100 * row.scatter_m:.1f} cm where the gripper acts (action {k + 1},"
        f" seen from {seen_from}), and their centre may be {100 * row.centre_off_m:.1f} cm off: {cause}"
    )
    numbers = {"scatter_m": row.scatter_m, "centre_off_m": row.centre_off_m}
    yield Finding("scattered-demonstrations", severity, message, f"actions[{k}]", numbers)
