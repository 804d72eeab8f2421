"""Demonstrations that scatter where the hand acts: poses are noisy, or the motion follows what is not known."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import CONTRADICTING, MISSED, ON_A_CIRCLE, SCATTERED, TURNED_ALONG
from app.pipeline.geometry import yaw_rad
from app.pipeline.order.order import Order
from app.pipeline.plans.rows import PlanRow, acting_rows
from app.pipeline.plans.support import Support, asked_anchor
from roboprompt_client.arrays import Array

SCATTER_M = 0.01  # what people and pose estimators do at their best
ALONG_SHARE = 0.4  # of their spread in the world, that offsets have along the object's axes if they turn with it
MIN_TURNED = 3  # demonstrations that show whether offsets turn with an object
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
    along = [
        (spread_m, shown[0].order, k, rows[k])
        for shown, rows in support.alike(asked)
        for k in acting_rows(rows)
        if (spread_m := _turned_along_m(shown, rows[k], round_objects)) > 0
    ]
    if along:
        spread_m, order, k, row = max(along, key=lambda item: item[0])
        message = (
            f"Where {len(row.off_m)} demonstrations act (action {k + 1}) turns with"
            f" {_seen_from(row, order, asked)}, and the hand does not turn: no row says both, and the place may be"
            f" {200 * spread_m:.1f} cm off. Turn the hand with the object in demonstrations, or name the place as an"
            " object of its own."
        )
        yield TURNED_ALONG.finding(message, f"actions[{k}]", _numbers(row), value=spread_m)
        return
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


def _turned_along_m(shown: Sequence[Demonstration], row: PlanRow, round_objects: frozenset[str]) -> float:
    """How far offsets in the world's axes spread (rms) that are alike along the object's own; 0 if they are not."""
    if row.anchors[0].frame != "w" or len(shown) < MIN_TURNED or row.anchors[0].object_name in round_objects:
        return 0.0
    poses = [item.object(anchor.object_name) for item, anchor in zip(shown, row.anchors, strict=True)]
    if any(pose.quaternion_xyzw is None for pose in poses):
        return 0.0
    yaws_rad = np.array([yaw_rad(Rotation.from_quat(pose.quaternion_xyzw)) for pose in poses])
    along_m = Rotation.from_euler("z", -yaws_rad[:, None]).apply(row.offsets_m)
    spread_m = _spread_m(row.offsets_m)
    turned = _spread_m(along_m) < ALONG_SHARE * spread_m and TURNED_ALONG.severity(spread_m) is not None
    return spread_m if turned else 0.0


def _spread_m(offsets_m: Array) -> float:
    return float(np.sqrt(((offsets_m - offsets_m.mean(axis=0)) ** 2).sum(axis=1).mean()))


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
