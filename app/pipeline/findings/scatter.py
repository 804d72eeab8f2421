"""Demonstrations that scatter where the hand acts: poses are noisy, or the motion follows what is not known."""

from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.findings import Finding
from app.pipeline.findings.rules import CONTRADICTING, MISSED, ON_A_CIRCLE, SCATTERED
from app.pipeline.order.order import Order
from app.pipeline.plans.rows import PlanRow, acting_rows
from app.pipeline.plans.support import Support, asked_anchor

SCATTER_M = 0.01  # what people and pose estimators do at their best
CIRCLE_SHARE = 0.25  # of their scatter, within which half of the demonstrations have one distance from the axis


def scatter_findings(support: Support, asked: Order, round_objects: frozenset[str] = frozenset()) -> Iterator[Finding]:
    """Where the hand acts, demonstrations that scatter say that poses are noisy, or that they contradict each other.

    Prompts show the demonstrations' centre, so that what counts is how far that is likely to be off. Where more than a
    third of them are far from it there is none, and the number of demonstrations makes up for nothing. Where the hand
    takes or presses something, a centre that may be off by more than fingers forgive is a danger.

    Args:
        round_objects: whose yaw the task says means nothing.
    """
    acting = [
        (shown[0].order, k, rows[k], _releases(rows, k))
        for shown, rows in support.alike(asked)
        for k in acting_rows(rows)
    ]
    if not acting:
        return
    order, k, row, _ = max(acting, key=lambda item: item[2].way_off_m)
    if CONTRADICTING.severity(row.way_off_m) is not None:
        message = (
            f"More than a third of {len(row.off_m)} demonstrations are {100 * row.way_off_m:.1f} cm or more from where"
            f" the others act (action {k + 1}, seen from {_seen_from(row, order, asked)}): no noise does that. They do"
            " it in several ways, were recorded in another frame, or what they follow is not among the objects."
        )
        yield CONTRADICTING.finding(message, f"actions[{k}]", _numbers(row), value=row.way_off_m)
        return
    turned = [item for item in acting if _on_a_circle(item[2], round_objects)]
    if turned:
        order, k, row, _ = max(turned, key=lambda item: item[2].scatter_m)
        message = (
            f"{len(row.off_m)} demonstrations act at one distance from {_seen_from(row, order, asked)}, on several"
            f" sides of it (action {k + 1}), and their centre is on none: they follow how it is turned, though"
            " it is declared symmetric. Correct the task's yaw_symmetry_deg."
        )
        yield ON_A_CIRCLE.finding(message, f"actions[{k}]", _numbers(row), value=row.scatter_m)
        return
    scattered = [item for item in acting if item[2].scatter_m > SCATTER_M]
    missed = [item for item in scattered if not item[3] and MISSED.severity(item[2].center_off_m) is not None]
    if scattered:
        rule = MISSED if missed else SCATTERED
        order, k, row, _ = max(missed or scattered, key=lambda item: item[2].center_off_m)
        message = (
            f"{len(row.off_m)} demonstrations scatter by {100 * row.scatter_m:.1f} cm where the hand acts (action"
            f" {k + 1}, seen from {_seen_from(row, order, asked)}), and their centre may be"
            f" {100 * row.center_off_m:.1f} cm off: poses are noisy, or what it follows is not among the objects."
        )
        yield rule.finding(message, f"actions[{k}]", _numbers(row), value=row.center_off_m)


def _on_a_circle(row: PlanRow, round_objects: frozenset[str]) -> bool:
    """Whether offsets scatter about the vertical axis of a round object, and hardly in their distance from it."""
    if ON_A_CIRCLE.severity(row.scatter_m) is None or row.anchors[0].object_name not in round_objects:
        return False
    radii_m = np.linalg.norm(row.offsets_m[:, :2], axis=1)
    off_circle_m = float(np.median(np.abs(radii_m - np.median(radii_m))))
    return off_circle_m < CIRCLE_SHARE * row.scatter_m


def _releases(rows: Sequence[PlanRow], k: int) -> bool:
    """Whether the hand lets something go: that may have no one place, as in a bin."""
    return k > 0 and rows[k].gripper_open and not rows[k - 1].gripper_open


def _seen_from(row: PlanRow, shown: Order, asked: Order) -> str:
    anchor = asked_anchor(row.anchors[0], shown, asked)
    return anchor.object_name or f"the {anchor.frame}"


def _numbers(row: PlanRow) -> dict[str, float]:
    return {"scatter_m": row.scatter_m, "way_off_m": row.way_off_m, "center_off_m": row.center_off_m}
