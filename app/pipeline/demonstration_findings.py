"""What is doubtful about the demonstrations that a prompt shows, as far as they bear on the scene that is asked about."""

from collections.abc import Iterator, Sequence

from app.pipeline.findings import Finding
from app.pipeline.plans.support import PlacedPlan

SCATTER_M = 0.03
SCATTER_DEG = 25.0


def scatter_findings(plans: Sequence[PlacedPlan]) -> Iterator[Finding]:
    """Where the gripper acts, demonstrations that scatter say that poses are noisy or an object is missing."""
    acting = [
        (k, row)
        for plan in plans
        for k, row in enumerate(plan)
        if k > 0 and plan[k - 1].grippers != row.grippers
        if row.tolerance_m > SCATTER_M or row.tolerance_deg > SCATTER_DEG
    ]
    if not acting:
        return
    k, row = max(acting, key=lambda item: item[1].tolerance_m)
    message = (
        f"Demonstrations scatter by {100 * row.tolerance_m:.1f} cm and {row.tolerance_deg:.0f} degrees where the"
        f" gripper acts (action {k + 1}, seen from {row.anchor.object_name or row.anchor.frame}): poses are noisy, or"
        " what it follows is not among the objects."
    )
    numbers = {"tolerance_m": row.tolerance_m, "tolerance_deg": row.tolerance_deg}
    yield Finding("scattered-demonstrations", "warning", message, f"actions[{k}]", numbers)
