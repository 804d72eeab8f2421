"""The demonstrated plans in the observed scene: whether one stays in the workspace, and with which turn of the gripper.

One turn holds for all actions of an answer: nothing spins while it is held, nor close to what was let go.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache

import numpy as np

from app.pipeline.episode import Query
from app.pipeline.errors import SceneOutOfBoundsError
from app.pipeline.findings import Finding
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.rules import GRIPPER_TURNED
from app.pipeline.plans.support import PlacedPlan
from app.pipeline.plans.turn import CLEARLY_DEG, WristRange, half_turned_plan
from app.services.predict.evidence import previewed
from app.services.predict.known import Known
from app.services.predict.prefix import Prefix
from app.services.predict.request import MAX_ACTIONS_ASKED, PredictOptions
from app.services.task_settings import TaskSettings
from roboprompt_client.errors import InvalidInputError, UnsafeActionError
from roboprompt_client.motion.guard import MotionGuard
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.types.poses import Pose

MAX_TASKS = 64  # whose demonstrated wrist angles are kept
Plans = Mapping[str, tuple[PlacedPlan, ...] | None]  # by instruction of a part; None where they are unknown


def place_plans(
    known: Known, prefix: Prefix, parts: Sequence[Query], options: PredictOptions
) -> tuple[Plans, list[Finding]]:
    """The demonstrated rows of each part of the instruction, and why the hand is turned in them, if it is.

    Raises:
        SceneOutOfBoundsError: if every plan of a part leaves the workspace here; no model can help.
        InvalidInputError: if the parts take more actions than the request allows.
    """
    placed = {} if prefix.support is None else {part.instruction: prefix.support.placed(part) for part in parts}
    if options.unsupported == "refuse":
        _require_within_workspace(placed.values(), known.settings.limits_of_motion())
    plans, turned = _turned_plans(placed, known.taught, known.settings, known.end_effector)
    _check_number([plans.get(part.instruction) for part in parts], options.max_actions)
    return plans, turned


def _require_within_workspace(parts: Iterable[Sequence[PlacedPlan] | None], limits: MotionLimits) -> None:
    """Refuse a scene in which every plan of a part leaves the workspace.

    Whether steps are short enough, and the way is free, depends on the reply.
    """
    for plans in parts:
        breaches = [_breach(plan, MotionLimits(limits.workspace)) for plan in plans or ()]
        if breaches and None not in breaches:
            raise next(breach for breach in breaches if breach is not None)


def _breach(plan: PlacedPlan, limits: MotionLimits) -> SceneOutOfBoundsError | None:
    """The object whose place leads out of the workspace, and the bound."""
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


def _turned_plans(
    plans: Plans, taught: Taught, settings: TaskSettings, hand: Pose | None
) -> tuple[Plans, list[Finding]]:
    """The plans with the hand turned by half a turn, and why; as they are where it stays.

    Args:
        hand: where it is before the first action, where that is known.
    """
    every = [plan for found in plans.values() for plan in found or ()] if settings.gripper_symmetry_deg else []
    if not every:
        return plans, []
    wrist = _wrist(taught, None if settings.arm is None else tuple(settings.robot_base))
    if not wrist.approaches:
        return plans, []
    other = [half_turned_plan(plan) for plan in every]
    beyond_deg, turned_deg = (wrist.beyond_deg(row.action for plan in item for row in plan) for item in (every, other))
    missed, turned_missed = (_out_of_reach(item, settings, hand) for item in (every, other))
    nearer = (turned_missed, turned_deg + CLEARLY_DEG) < (missed, beyond_deg)
    if not nearer:
        return plans, []
    reason = (
        f"otherwise the arm does not get to {missed} of them"
        if turned_missed < missed
        else f"its wrist is then {turned_deg:.0f} degrees beyond the demonstrated angles instead of {beyond_deg:.0f}"
    )
    message = f"In all actions the gripper is turned by 180 degrees from what the reply says: {reason}."
    numbers = {"beyond_deg": beyond_deg, "turned_beyond_deg": turned_deg}
    turned = {name: found and tuple(map(half_turned_plan, found)) for name, found in plans.items()}
    return turned, [GRIPPER_TURNED.finding(message, "actions", numbers)]


@lru_cache(MAX_TASKS)
def _wrist(taught: Taught, base_m: tuple[float, ...] | None) -> WristRange:
    """Kept for each version of a task, as `taught` is."""
    return WristRange(taught.demonstrations, None if base_m is None else np.array(base_m))


def _out_of_reach(plans: Sequence[PlacedPlan], settings: TaskSettings, hand: Pose | None) -> int:
    """To how many actions the arm, if it is known, finds no straight way."""
    if settings.arm is None:
        return 0
    return sum(not item.reachable for plan in plans for item in previewed([row.action for row in plan], settings, hand))


def _check_number(placed: Sequence[tuple[PlacedPlan, ...] | None], most: int) -> None:
    """Refuse several parts whose shortest plans have more actions than `most`, before an LLM writes them in vain."""
    fewest = sum(min(map(len, plans), default=1) if plans else 1 for plans in placed)
    if len(placed) > 1 and fewest > most:
        message = f"is {most}, but the {len(placed)} parts of the instruction take {fewest} actions or more"
        raise InvalidInputError("max_actions", message, f"{fewest} or more, at most {MAX_ACTIONS_ASKED}")
