"""Whether some demonstrated plan stays in the workspace in an observed scene; otherwise no model can help."""

from collections.abc import Iterable, Sequence

from app.pipeline.errors import SceneOutOfBoundsError
from app.pipeline.plans.support import PlacedPlan
from roboprompt_client.errors import UnsafeActionError
from roboprompt_client.motion_guard import MotionGuard
from roboprompt_client.motion_limits import MotionLimits


def require_within_workspace(parts: Iterable[Sequence[PlacedPlan] | None], limits: MotionLimits) -> None:
    """Refuse a scene in which every plan of a part leaves the workspace.

    Whether steps are short enough, and the way is free, depends on the reply.

    Args:
        parts: of the instruction, the plans that may carry each out; None where they are not known.

    Raises:
        SceneOutOfBoundsError: naming the object whose place leads there, and the bound.
    """
    for plans in parts:
        breaches = [_breach(plan, MotionLimits(limits.workspace)) for plan in plans or ()]
        if breaches and None not in breaches:
            raise next(breach for breach in breaches if breach is not None)


def _breach(plan: PlacedPlan, limits: MotionLimits) -> SceneOutOfBoundsError | None:
    guard = MotionGuard(limits, len(plan))
    for number, row in enumerate(plan, start=1):
        try:
            guard.check(row.action)
        except UnsafeActionError as error:
            quantity = error.field.partition(".")[2]
            message = f"leads out of the workspace: in action {number} of its plan {quantity} {error.message}"
            field = f"objects[{row.anchor.object_name}]" if row.anchor.object_name else "objects"
            return SceneOutOfBoundsError(field, message, error.bound)
    return None
