"""Whether a question's actions are carried out with the gripper turned by half a turn, where its task says that it may.

One turn holds for all actions of an answer: nothing spins while it is held, nor close to what was let go.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from app.pipeline.findings import Finding
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.rules import GRIPPER_TURNED
from app.pipeline.plans.support import PlacedPlan
from app.pipeline.plans.turn import CLEARLY_DEG, WristRange, half_turned_plan
from app.services.predict.evidence import previewed
from app.services.task_settings import TaskSettings
from roboprompt_client.motion_limits import Pose

MAX_TASKS = 64  # whose demonstrated wrist angles are kept
Plans = Mapping[str, tuple[PlacedPlan, ...] | None]


def turned_plans(
    plans: Plans, taught: Taught, settings: TaskSettings, hand: Pose | None
) -> tuple[Plans, list[Finding]]:
    """The plans with the hand turned, and why; as they are where it stays.

    Args:
        hand: where it is before the first action, where that is known.
    """
    every = [plan for found in plans.values() for plan in found or ()] if settings.gripper_symmetry_deg else []
    if not every:
        return plans, []
    wrist = _wrist(taught, None if settings.arm is None else tuple(settings.robot_base))
    other = [half_turned_plan(plan) for plan in every]
    beyond_deg, turned_deg = (wrist.beyond_deg(row.action for plan in item for row in plan) for item in (every, other))
    missed, turned_missed = (_out_of_reach(item, settings, hand) for item in (every, other))
    nearer = (turned_missed, turned_deg + CLEARLY_DEG) < (missed, beyond_deg)
    if not wrist.approaches or not nearer:
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
