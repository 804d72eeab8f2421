"""What is doubtful about the demonstrations that a prompt shows, as far as they bear on the scene at hand."""

from collections.abc import Iterator, Sequence

from app.pipeline.findings import Finding, Severity
from app.pipeline.plans.support import PlacedPlan, PlacedRow

SCATTER_M = 0.01
CLOSER = 0.5  # times the scatter of a row, from which on a later one keeps to something
CENTRE_OFF_M = 0.012  # as much as pose estimators err without harm; measured: docs/results/findings.md


def scatter_findings(plans: Sequence[PlacedPlan]) -> Iterator[Finding]:
    """Where the gripper acts, demonstrations that scatter say that poses are noisy or an object is missing.

    Prompts show the demonstrations' centre, so that what counts is how far that is likely to be off.
    """
    acting = [(k, plan[k]) for plan in plans for k in range(1, len(plan)) if _acts(plan, k)]
    scattered = [item for item in acting if item[1].scatter_m > SCATTER_M]
    if not scattered:
        return
    k, row = max(scattered, key=lambda item: item[1].centre_off_m)
    severity: Severity = "warning" if row.centre_off_m > CENTRE_OFF_M else "info"
    seen_from = row.anchor.object_name or row.anchor.frame
    message = (
        f"{row.number} demonstrations scatter by {100 * row.scatter_m:.1f} cm where the gripper acts (action {k + 1},"
        f" seen from {seen_from}), and their centre may be {100 * row.centre_off_m:.1f} cm off: poses are noisy, or"
        " what it follows is not among the objects."
    )
    numbers = {"scatter_m": row.scatter_m, "centre_off_m": row.centre_off_m}
    yield Finding("scattered-demonstrations", severity, message, f"actions[{k}]", numbers)


def _acts(plan: PlacedPlan, k: int) -> bool:
    """Whether the gripper acts on something in a row: people close an empty hand on the way, wherever they are.

    That is so where it switches only once, and the hand comes to something later that it keeps to more closely.
    """
    switches = [j for j in range(1, len(plan)) if plan[j - 1].grippers != plan[j].grippers]
    return k in switches and (len(switches) > 1 or not any(_is_closer(later, plan[k]) for later in plan[k + 1 :]))


def _is_closer(one: PlacedRow, other: PlacedRow) -> bool:
    return one.scatter_m < CLOSER * other.scatter_m
