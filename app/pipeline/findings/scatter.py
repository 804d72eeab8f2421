"""Demonstrations that scatter where the hand acts: poses are noisy, or the motion follows what is not known."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import APART, CONTRADICTING, MISSED, ON_A_CIRCLE, SCATTERED, Rule
from app.pipeline.geometry import yaw_rad
from app.pipeline.order.order import Order
from app.pipeline.plans.rows import PlanRow, acting_rows
from app.pipeline.plans.support import Support, asked_anchor
from roboprompt_client.arrays import Array

SCATTER_M = 0.01  # what people and pose estimators do at their best
OTHER_SHARE = 0.4  # of their spread, that offsets have along the other axes, the object's or the world's, if these hold
MIN_TURNED = 3  # demonstrations that show whether offsets turn with an object
CIRCLE_SHARE = 0.25  # of their scatter, within which half of the demonstrations have one distance from the axis


@dataclass(frozen=True, eq=False)
class _Acting:
    """A row at which the hand acts.

    Attributes:
        seen_from: what the row is relative to, as it is called in the scene that is asked about.
        apart_m: see `_apart_m`.
        releases: whether the hand lets something go: that may have no one place, as in a bin.
    """

    index: int
    row: PlanRow
    seen_from: str
    apart_m: float
    releases: bool

    def finding(self, rule: Rule, message: str, value: float) -> Finding:
        row = self.row
        numbers = {"scatter_m": row.scatter_m, "way_off_m": row.way_off_m, "center_off_m": row.center_off_m}
        return rule.finding(message, f"actions[{self.index}]", numbers, value=value)


def scatter_findings(support: Support, asked: Order, round_objects: frozenset[str] = frozenset()) -> Iterator[Finding]:
    """Where the hand acts, demonstrations that scatter say that poses are noisy, or that they contradict each other.

    Prompts show the demonstrations' centre, so that what counts is how far that is likely to be off. Where more than a
    third of them are far from it there is none, and the number of demonstrations makes up for nothing. Where the hand
    takes or presses something, a centre that may be off by more than fingers forgive is a danger.

    Args:
        round_objects: whose yaw the task says means nothing.
    """
    acting = [
        _Acting(
            k,
            rows[k],
            _seen_from(rows[k], shown[0].order, asked),
            _apart_m(shown, rows[k], round_objects),
            releases=k > 0 and rows[k].gripper_open and not rows[k - 1].gripper_open,
        )
        for shown, rows in support.alike(asked)
        for k in acting_rows(rows)
    ]
    apart = [item for item in acting if item.apart_m > 0]
    contradicting = [item for item in acting if CONTRADICTING.severity(item.row.way_off_m) is not None]
    on_a_circle = [item for item in acting if _on_a_circle(item.row, round_objects)]
    scattered = [item for item in acting if item.row.scatter_m > SCATTER_M]
    if apart:
        yield _apart_finding(max(apart, key=lambda item: item.apart_m))
    elif contradicting:
        yield _contradicting_finding(max(contradicting, key=lambda item: item.row.way_off_m))
    elif on_a_circle:
        yield _circle_finding(max(on_a_circle, key=lambda item: item.row.scatter_m))
    elif scattered:
        yield _scattered_finding(scattered)


def _apart_finding(item: _Acting) -> Finding:
    place, hand = "turns with", "does not turn"
    if item.row.anchors[0].frame == "o":
        place, hand = "does not turn with", "turns"
    message = (
        f"Where {len(item.row.off_m)} demonstrations act (action {item.index + 1}) {place} {item.seen_from}, and the"
        f" hand {hand}: no row says both, and the place may be {200 * item.apart_m:.1f} cm off. Turn the hand as the"
        " place turns in demonstrations, or name the place as an object of its own."
    )
    return item.finding(APART, message, item.apart_m)


def _contradicting_finding(item: _Acting) -> Finding:
    message = (
        f"More than a third of {len(item.row.off_m)} demonstrations are {100 * item.row.way_off_m:.1f} cm or more from"
        f" where the others act (action {item.index + 1}, seen from {item.seen_from}): no noise does that. They do it"
        " in several ways, were recorded in another frame, or what they follow is not among the objects."
    )
    return item.finding(CONTRADICTING, message, item.row.way_off_m)


def _circle_finding(item: _Acting) -> Finding:
    message = (
        f"{len(item.row.off_m)} demonstrations act at one distance from {item.seen_from}, on several sides of it"
        f" (action {item.index + 1}), and their centre is on none: they follow how it is turned, though it is declared"
        " symmetric. Correct the task's yaw_symmetry_deg."
    )
    return item.finding(ON_A_CIRCLE, message, item.row.scatter_m)


def _scattered_finding(scattered: Sequence[_Acting]) -> Finding:
    missed = [item for item in scattered if not item.releases and MISSED.severity(item.row.center_off_m) is not None]
    item = max(missed or scattered, key=lambda item: item.row.center_off_m)
    message = (
        f"{len(item.row.off_m)} demonstrations scatter by {100 * item.row.scatter_m:.1f} cm where the hand acts (action"
        f" {item.index + 1}, seen from {item.seen_from}), and their centre may be {100 * item.row.center_off_m:.1f} cm"
        " off: poses are noisy, or what it follows is not among the objects."
    )
    return item.finding(MISSED if missed else SCATTERED, message, item.row.center_off_m)


def _apart_m(shown: Sequence[Demonstration], row: PlanRow, round_objects: frozenset[str]) -> float:
    """How far offsets spread (rms) along the row's axes that are alike along the object's others; 0 if they are not.

    Rotations decide the frame of such a row: of its place it is the wrong one.
    """
    name, frame = row.anchors[0]
    if not name or len(shown) < MIN_TURNED or name in round_objects or {a.frame for a in row.anchors} != {frame}:
        return 0.0
    poses = [item.object(anchor.object_name) for item, anchor in zip(shown, row.anchors, strict=True)]
    if any(pose.quaternion_xyzw is None for pose in poses):
        return 0.0
    yaws_rad = np.array([yaw_rad(Rotation.from_quat(pose.quaternion_xyzw)) for pose in poses])
    to_other = Rotation.from_euler("z", (yaws_rad if frame == "o" else -yaws_rad)[:, None])
    spread_m = _spread_m(row.offsets_m)
    apart = _spread_m(to_other.apply(row.offsets_m)) < OTHER_SHARE * spread_m
    return spread_m if apart and APART.severity(spread_m) is not None else 0.0


def _spread_m(offsets_m: Array) -> float:
    return float(np.sqrt(((offsets_m - offsets_m.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _on_a_circle(row: PlanRow, round_objects: frozenset[str]) -> bool:
    """Whether offsets scatter about the vertical axis of a round object, and hardly in their distance from it."""
    if ON_A_CIRCLE.severity(row.scatter_m) is None or row.anchors[0].object_name not in round_objects:
        return False
    radii_m = np.linalg.norm(row.offsets_m[:, :2], axis=1)
    off_circle_m = float(np.median(np.abs(radii_m - np.median(radii_m))))
    return off_circle_m < CIRCLE_SHARE * row.scatter_m


def _seen_from(row: PlanRow, shown: Order, asked: Order) -> str:
    anchor = asked_anchor(row.anchors[0], shown, asked)
    return anchor.object_name or f"the {anchor.frame}"
