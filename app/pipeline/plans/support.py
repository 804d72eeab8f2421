"""Checks whether demonstrations support an action: it lies near theirs, relative to the anchor of its row."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration, Query
from app.pipeline.errors import UnsupportedActionError
from app.pipeline.groups import Group
from app.pipeline.order.order import Order
from app.pipeline.plans.rows import MARGIN_DEG, MARGIN_M, PlanRow, plan_rows
from app.pipeline.representation.anchors import Anchor, AnchorPose, anchor_pose, asked_anchor
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

MAX_STRUNG = 64  # combinations of the plans of several clauses


@dataclass(frozen=True, eq=False)
class PlacedRow:
    """A row of a plan in an observed scene.

    Attributes:
        demonstrated: the row, with its scatter.
        anchor, pose: what it is relative to, and where that is in the scene.
        action: its center in the world frame.
    """

    demonstrated: PlanRow
    anchor: Anchor
    pose: AnchorPose
    action: EndEffectorAction

    def seen_from_anchor(self, action: EndEffectorAction) -> tuple[Array, Array]:
        """Return an action's offset (3,) in meters along the anchor's axes, and its rotation (4,) relative to them."""
        # For one pose floats take a tenth of the time that scipy's Rotation takes.
        to_place, to_hand = map(quaternions.inverse, (self.pose.place_axes_xyzw, self.pose.hand_axes_xyzw))
        offset_m = quaternions.rotated(to_place, action.position_m - self.pose.origin_m)
        return offset_m, quaternions.canonical(quaternions.product(to_hand, action.quaternion_xyzw))

    def away(self, action: EndEffectorAction) -> tuple[float, float]:
        """Return the distance of an action from the row's center, in meters and degrees."""
        way_m = action.position_m - self.action.position_m
        off_m = math.sqrt(way_m.dot(way_m))  # of three numbers numpy's norm takes five times as long
        turn = quaternions.product(quaternions.inverse(self.action.quaternion_xyzw), action.quaternion_xyzw)
        return off_m, math.degrees(quaternions.angle_rad(turn))

    def beyond(self, action: EndEffectorAction) -> tuple[float, float]:
        """Return how far an action is beyond the farthest demonstration, in meters and degrees; 0 within."""
        (off_m, off_deg), (reach_m, reach_deg) = self.away(action), self.demonstrated.reach
        return max(0.0, off_m - (reach_m - MARGIN_M)), max(0.0, off_deg - (reach_deg - MARGIN_DEG))

    def supports(self, action: EndEffectorAction) -> bool:
        """Return whether demonstrations support the action."""
        (off_m, off_deg), (reach_m, reach_deg) = self.away(action), self.demonstrated.reach
        return off_m <= reach_m and off_deg <= reach_deg and action.gripper_open in self.demonstrated.grippers


PlacedPlan = tuple[PlacedRow, ...]


class DemonstratedPlan(NamedTuple):
    """Demonstrations of one form of instruction and one plan, as they were recorded, with their rows."""

    demonstrations: Group
    rows: tuple[PlanRow, ...]

    @property
    def order(self) -> Order:
        """The instruction of the first demonstration."""
        return self.demonstrations[0].order


@dataclass(frozen=True, eq=False)
class Support:
    """The plans of one prompt's demonstrations, as they were recorded."""

    plans: tuple[DemonstratedPlan, ...]

    @classmethod
    def of(
        cls, groups: Sequence[Sequence[Demonstration]], written: Sequence[Sequence[Demonstration]] | None = None
    ) -> "Support":
        """Return the support of groups of demonstrations; each group has one plan.

        Args:
            written: the same groups as a prompt shows them, which decide the anchors: a reply's rows are relative to
                the frames in the prompt, which may differ from those of the recorded actions where several fit.
        """
        pairs = zip(groups, written or groups, strict=True)
        plans = (DemonstratedPlan(tuple(group), plan_rows(group, shown)) for group, shown in pairs if group[0].actions)
        return cls(tuple(plans))

    def placed(self, query: Query) -> tuple[PlacedPlan, ...] | None:
        """Return the plans for the query (see `alike`), placed in its scene.

        If demonstrations carry out one clause each, the plans of several clauses are combined in their order. None if
        demonstrations have another number of clauses: then the rows that are asked for are not known.

        Raises:
            InvalidInputError: if the plans combine in more than `MAX_STRUNG` ways.
        """
        alike, clauses = self.alike(query.order), query.order.clauses
        number = len(alike[0].order.clauses) if alike else len(clauses)
        if number == len(clauses):
            return tuple(_placed_plan(plan, query) for plan in alike)
        if number > 1:
            return None
        each = [self.placed(replace(query, instruction=clause.text)) or () for clause in clauses]
        if (combined := math.prod(map(len, each))) > MAX_STRUNG:
            message = f"has {len(clauses)} clauses, whose demonstrated plans combine in {combined} ways"
            raise InvalidInputError("instruction", message, f"at most {MAX_STRUNG} ways: fewer clauses at once")
        return tuple(tuple(chain.from_iterable(plans)) for plans in product(*each))

    def alike(self, asked: Order) -> tuple[DemonstratedPlan, ...]:
        """Return the plans of the same instruction form; without any those with as many clauses, else all."""
        same = tuple(plan for plan in self.plans if plan.order.form == asked.form)
        as_long = tuple(plan for plan in self.plans if len(plan.order.clauses) == len(asked.clauses))
        return same or as_long or self.plans


def _placed_plan(plan: DemonstratedPlan, query: Query) -> PlacedPlan:
    rows = plan.rows
    anchors = [asked_anchor(row.anchors[0], plan.order, query.order) for row in rows]
    poses = [anchor_pose(anchor, query) for anchor in anchors]
    positions_m, hands = AnchorPose.stacked(poses).placed(
        np.array([row.center_m for row in rows]), Rotation.concatenate([row.mean_rotation for row in rows])
    )
    states = [row.gripper_open for row in rows]
    actions = EndEffectorAction.many(positions_m, hands.as_quat(canonical=True), states)
    return tuple(map(PlacedRow, rows, anchors, poses, actions))


class SupportGuard:
    """Checks the actions of one reply in their order against the plans that they may carry out.

    Args:
        plans: placed in the observed scene.
        num_before: number of actions of earlier parts of the instruction; indices in errors count them.
    """

    def __init__(self, plans: Sequence[PlacedPlan], num_before: int = 0) -> None:
        self._plans = list(plans)
        self._before = num_before
        self._index = 0

    def check(self, action: EndEffectorAction) -> PlacedRow:
        """Check the next action, and return the row that it carries out.

        Raises:
            UnsupportedActionError: naming its index, and what was expected.
        """
        index = self._index
        going_on = [plan for plan in self._plans if index < len(plan)]
        if not going_on:
            most = self._before + max(map(len, self._plans), default=0)
            message = "is one more than demonstrated"
            raise UnsupportedActionError(self._before + index, message, f"at most {most} actions")
        supporting = [plan for plan in going_on if plan[index].supports(action)]
        if not supporting:
            raise _unsupported(self._before + index, action, _nearest([plan[index] for plan in going_on], action))
        self._plans, self._index = supporting, index + 1
        return _nearest([plan[index] for plan in supporting], action)

    def pass_by(self) -> None:
        """Continue after an action that `check` refused, with every plan that has a row there."""
        self._plans = [plan for plan in self._plans if self._index < len(plan)] or self._plans
        self._index += 1

    def finish(self) -> None:
        """Check that the reply may end here.

        Raises:
            UnsupportedActionError: if no demonstration ends so early.
        """
        if all(len(plan) != self._index for plan in self._plans):
            missing, fewest = self._before + self._index, self._before + min(map(len, self._plans))
            raise UnsupportedActionError(missing, "is missing: the reply ends too early", f"{fewest} actions")


def _nearest(rows: Sequence[PlacedRow], action: EndEffectorAction) -> PlacedRow:
    return rows[0] if len(rows) == 1 else min(rows, key=lambda row: row.away(action))


def _unsupported(index: int, action: EndEffectorAction, nearest: PlacedRow) -> UnsupportedActionError:
    (off_m, off_deg), (reach_m, reach_deg) = nearest.away(action), nearest.demonstrated.reach
    of = nearest.anchor.described
    expected = f"{nearest.action.position_m.round(3).tolist()} m"
    if off_m > reach_m:
        bound = f"within {100 * reach_m:.1f} cm of {expected}, seen from {of}"
        return UnsupportedActionError(index, f"is {100 * off_m:.1f} cm from where demonstrations go", bound)
    if off_deg > reach_deg:
        bound = f"within {reach_deg:.1f} degrees, seen from {of}"
        return UnsupportedActionError(index, f"is turned by {off_deg:.1f} degrees from the demonstrations", bound)
    state = "open" if action.gripper_open else "closed"
    return UnsupportedActionError(index, f"has the gripper {state}", "the gripper as demonstrations have it there")
