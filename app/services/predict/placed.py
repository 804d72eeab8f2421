"""Place the demonstrated plans in the observed scene: refuse those outside the workspace, choose the gripper's turn.

The turn (0 or 180 degrees) is the same for all actions of an answer, so that no held object is spun.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from app.pipeline.episode import Query
from app.pipeline.errors import SceneOutOfBoundsError
from app.pipeline.finding import Finding, finding
from app.pipeline.representation.base import row_count_bounds
from app.pipeline.skill.skills import Skills
from app.pipeline.skill.support import PlacedPlan
from app.pipeline.skill.wrist import CLEARLY_DEG, WristRange, half_turned
from app.services.predict.demonstrations import TaskVersion
from app.services.predict.request import PredictOptions
from app.services.task_settings import TaskSettings
from roboprompt_client.arms.driver import Calibration
from roboprompt_client.arms.geometry import Chain
from roboprompt_client.arms.preview import Previewed, preview_plan
from roboprompt_client.errors import InvalidInputError, MotionError, UnsafeActionError
from roboprompt_client.motion.guard import MotionGuard
from roboprompt_client.motion.limits import MAX_ACTIONS, USUAL_ACTIONS, MotionLimits
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, Pose

MAX_TASKS = 64  # whose recorded wrist angles are kept
Plans = Sequence[tuple[PlacedPlan, ...] | None]  # of each part; None where they are unknown


class Placed(NamedTuple):
    """The parts of an instruction with their plans.

    Attributes:
        parts: each in the scene that those before leave, with symmetric objects turned as demonstrations have them.
        plans: the demonstrated rows of each part.
        turned: a finding if the hand is turned in them.
        max_actions: how many the answer may have.
    """

    parts: tuple[Query, ...]
    plans: Plans
    turned: list[Finding]
    max_actions: int


def place_plans(
    skills: Skills, asked: Sequence[Query], options: PredictOptions, task: TaskVersion, hand: Pose | None
) -> Placed:
    """Place the plans of each part.

    Args:
        skills: of the demonstrations that the prompt shows.
        hand: where it is before the first action; None if unknown.

    Raises:
        SceneOutOfBoundsError: if every plan of a part leaves the workspace in this scene.
        InvalidInputError: if the parts take more actions than the request allows.
    """
    placed = list(skills.in_turn(asked))
    if options.unsupported == "refuse":
        _require_within_workspace([plans for _, plans in placed], task.limits)
    parts = tuple(_turned_as_shown(part, plans) for part, plans in placed)
    plans, turned = _turned_plans([plans for _, plans in placed], skills, task.settings, hand)
    return Placed(parts, plans, turned, _actions_allowed(skills, parts, plans, options.max_actions))


def _turned_as_shown(part: Query, plans: Sequence[PlacedPlan] | None) -> Query:
    rows = plans[0] if plans else ()
    return replace(part, objects=rows[0].scene.as_turned(part)) if rows else part


def _require_within_workspace(parts: Iterable[Sequence[PlacedPlan] | None], limits: MotionLimits) -> None:
    """Refuse a scene in which every plan of a part leaves the workspace.

    Whether steps are short enough, and the way is free, depends on the reply.
    """
    for plans in parts:
        breaches = [_breach(plan, MotionLimits(limits.workspace)) for plan in plans or ()]
        if breaches and None not in breaches:
            raise next(breach for breach in breaches if breach is not None)


def _breach(plan: PlacedPlan, limits: MotionLimits) -> SceneOutOfBoundsError | None:
    """Return the error for the first row outside the workspace, with object and bound; None if all are inside."""
    guard = MotionGuard(limits, len(plan))
    for number, row in enumerate(plan, start=1):
        try:
            guard.check(row.action)
        except UnsafeActionError as error:
            quantity = error.field.partition(".")[2]
            message = f"leads out of the workspace: in action {number} of its plan {quantity} {error.message}"
            field = f"objects[{row.object_name}]" if row.object_name else "objects"
            return SceneOutOfBoundsError(field, message, error.bound)
    return None


def _turned_plans(
    plans: Plans, skills: Skills, settings: TaskSettings, hand: Pose | None
) -> tuple[Plans, list[Finding]]:
    """The plans with the hand turned by half a turn, and why; as they are where it stays.

    Args:
        hand: where it is before the first action, where that is known.
    """
    every = [plan for found in plans for plan in found or ()] if settings.gripper_symmetry_deg else []
    if not every:
        return plans, []
    wrist = _wrist(skills, None if settings.arm is None else tuple(settings.robot_base))
    if not wrist.approaches:
        return plans, []
    other = list(map(_half_turned, every))
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
    turned = [found and tuple(map(_half_turned, found)) for found in plans]
    return turned, [finding("symmetry-shown", 1.0, message, "actions", symmetry_deg=180.0, **numbers)]


def _half_turned(plan: PlacedPlan) -> PlacedPlan:
    return tuple(replace(row, action=half_turned(row.action)) for row in plan)


@lru_cache(MAX_TASKS)
def _wrist(skills: Skills, base_m: tuple[float, ...] | None) -> WristRange:
    """Kept for each version of a task, as `skills` are."""
    rows = [plan.shown for form in skills.forms for plan in skills.of_form(form).plans]
    return WristRange(rows, None if base_m is None else np.array(base_m))


def _out_of_reach(plans: Sequence[PlacedPlan], settings: TaskSettings, hand: Pose | None) -> int:
    """Return how many actions the arm cannot reach on a straight path; 0 for an unknown arm."""
    if settings.arm is None:
        return 0
    return sum(not item.reachable for plan in plans for item in previewed([row.action for row in plan], settings, hand))


def _actions_allowed(skills: Skills, parts: Sequence[Query], plans: Plans, asked: int | None) -> int:
    """Return how many actions the answer may have: as asked for, else what the plans of the parts need, 25 at least.

    Raises:
        InvalidInputError: if several parts take more, before an LLM writes them in vain.
    """
    counts = [_row_counts(skills, part, found) for part, found in zip(parts, plans, strict=True)]
    fewest, most = sum(map(min, counts)), sum(map(max, counts))
    allowed = asked or min(max(most, USUAL_ACTIONS), MAX_ACTIONS)
    if len(parts) > 1 and fewest > allowed:
        message = f"is {allowed}, but the {len(parts)} parts of the instruction take {fewest} actions or more"
        raise InvalidInputError("max_actions", message, f"{fewest} or more, at most {MAX_ACTIONS}")
    return allowed


def _row_counts(skills: Skills, part: Query, placed: Sequence[PlacedPlan] | None) -> Sequence[int]:
    """Return the number of rows of each plan; of unknown plans what demonstrations with other clauses suggest."""
    if placed is None:
        return row_count_bounds([item.demonstration for item in skills.recordings], part.order, MAX_ACTIONS)
    return [len(plan) for plan in placed] or [1]


def previewed(actions: Sequence[EndEffectorAction], settings: TaskSettings, hand: Pose | None) -> tuple[Previewed, ...]:
    """Return each action with distance from the base, reachability, and the present keep-out boxes in the way.

    Args:
        hand: its pose before the first action; None if unknown.
    """
    base = settings.base()
    geometry = settings.geometry()
    joints = None if geometry is None else _joints_rad(geometry, base, hand)
    start_m, limits = None if hand is None else hand.position_m, settings.limits_of_motion()
    return preview_plan(actions, base, limits, geometry=geometry, joints_rad=joints, start_m=start_m)


def _joints_rad(geometry: Chain, base: Calibration, hand: Pose | None) -> Array:
    if hand is None:
        return geometry.ready_rad
    position_m, quaternion = np.array(hand.position_m), np.array(hand.quaternion_xyzw)
    try:
        return geometry.way(geometry.ready_rad, *base.to_base(position_m, quaternion))
    except MotionError:
        return geometry.ready_rad
