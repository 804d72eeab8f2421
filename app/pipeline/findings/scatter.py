"""Demonstrations that scatter where the hand acts: poses are noisy, or the motion follows something unknown."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.explained import SCATTER_M, explained_m, unlike_most_m
from app.pipeline.findings.rules import (
    APART,
    CONTRADICTING,
    EXPLAINED_AWAY,
    HAND_APART,
    MISSED,
    NOT_SHOWN_APART,
    ON_A_CIRCLE,
    SCATTERED,
    TURNED_IN_TWO,
    TURNED_OTHERWISE,
    UNLIKE_MOST,
    Rule,
)
from app.pipeline.order.order import Order
from app.pipeline.plans.agreement import two_ways
from app.pipeline.plans.rows import PlanRow, acting_rows, touching_rows, turn_off_deg
from app.pipeline.plans.support import Support
from app.pipeline.representation.anchor_scatter import MIN_TURNED, TURNED_SHARE, much_less, scatters_m
from app.pipeline.representation.anchors import MIXED_FRAMES, WORLD, Anchor, asked_anchor
from app.pipeline.thresholds import M_PER_RAD

APART_SHARES = np.array([TURNED_SHARE, 0.4])  # the share of the scatter of places and rotations that other axes leave
CIRCLE_SHARE = 0.25  # the share of the scatter by which the median distance from the axis may vary on a circle


@dataclass(frozen=True, eq=False)
class _Acting:
    """A row at which the hand acts.

    Attributes:
        seen_from: the object or frame that the row is relative to, by its name in the observed scene.
        apart_m, hand_apart_deg: see `_apart`.
        explained_m, by: see `app.pipeline.findings.explained.explained_m`.
        two_turns_deg: see `_two_turns_deg`.
        on_a_circle_m: see `_on_a_circle_m`.
        unlike_most_m: see `app.pipeline.findings.explained.unlike_most_m`.
        loosely: whether the hand releases something, or acts with a held object; both may happen anywhere, as in a bin.
        turn_off_deg: see `app.pipeline.plans.rows.turn_off_deg`, of a held object.
    """

    index: int
    row: PlanRow
    seen_from: str
    apart_m: float
    hand_apart_deg: float
    explained_m: float
    by: str
    two_turns_deg: float
    on_a_circle_m: float
    unlike_most_m: float
    loosely: bool
    turn_off_deg: float

    def finding(self, rule: Rule, message: str, value: float) -> Finding:
        row = self.row
        numbers = {"scatter_m": row.scatter_m, "way_off_m": row.way_off_m, "center_off_m": row.center_off_m}
        return rule.finding(message, f"actions[{self.index}]", numbers, value=value)


def scatter_findings(support: Support, asked: Order, round_objects: frozenset[str] = frozenset()) -> Iterator[Finding]:
    """Yield at most one finding for demonstrations that scatter, or contradict each other, where the hand acts.

    Prompts show the robust center of the demonstrations, so that the standard error of the center counts. If more than
    a third of them are far from it, there is no common center, however many they are. Where the hand grasps or presses
    something, a standard error beyond the tolerance of a grasp is a danger.

    Args:
        round_objects: objects with a declared yaw symmetry.
    """
    acting = [
        _Acting(
            k,
            rows[k],
            _seen_from(rows[k], shown[0].order, asked),
            *(_apart(shown, rows[k], k, support.tilted, round_objects) if k in touching else (0.0, 0.0)),
            *explained_m(shown, rows[k], by_objects=k in touching),
            _two_turns_deg(rows[k], round_objects) if k in touching else 0.0,
            _on_a_circle_m(rows[k], round_objects),
            unlike_most_m(shown, rows[k]),
            loosely=k not in touching or (k > 0 and rows[k].gripper_open and not rows[k - 1].gripper_open),
            turn_off_deg=0.0 if k in touching else turn_off_deg(rows, k),
        )
        for shown, rows in support.alike(asked)
        for touching in [touching_rows(rows)]
        for k in acting_rows(rows)
    ]
    for rule, value, message in DOUBTS:
        worst = max(acting, key=value, default=None)
        if worst is not None and rule.severity(value(worst)) is not None:
            yield worst.finding(rule, message(worst), value(worst))
            return
    if scattered := [item for item in acting if item.row.scatter_m > SCATTER_M]:
        yield _scattered_finding(scattered)


def _apart_message(item: _Acting) -> str:
    turns = "does not turn" if item.row.anchors[0].place_turns else "turns"
    return (
        f"The place where {len(item.row.off_m)} demonstrations act (action {item.index + 1}) probably {turns} with"
        f" {item.seen_from}, unlike the hand: it may be {200 * item.apart_m:.1f} cm off. Record more demonstrations"
        f" with {item.seen_from} at other angles, or send the place as an object of its own."
    )


def _hand_apart_message(item: _Acting) -> str:
    turns = "does not turn" if item.row.anchors[0].hand_turns else "turns"
    return (
        f"Where {len(item.row.off_m)} demonstrations act (action {item.index + 1}), the hand probably {turns} with"
        f" {item.seen_from}, unlike the place: it may be turned wrongly by {2 * item.hand_apart_deg:.0f} degrees."
        f" Record more demonstrations with {item.seen_from} at other angles."
    )


def not_shown_findings(shown: Support | None, taught: Support, asked: Order) -> Iterator[Finding]:
    """Yield a finding if only place or hand turns with an object, and the prompt shows too few demonstrations of that.

    Args:
        shown: the plans in the prompt; None where they are not known.
        taught: the plans of all demonstrations of the task.
    """
    missing = _mixed(taught, asked) - (set() if shown is None else _mixed(shown, asked))
    for name in sorted({anchor.object_name or "an object" for anchor in missing})[:1]:
        message = (
            f"What the hand does at {name} follows it in part: along some axes only, or only its position or rotation"
            " turns with it. The prompt has too few demonstrations to show that. Raise num_demonstrations."
        )
        yield NOT_SHOWN_APART.finding(message, "demonstrations")


def _mixed(support: Support, asked: Order) -> set[Anchor]:
    """Return the anchors with a mixed frame at which the hand acts, by the names in the observed scene.

    Those that have other origins along single axes count as one, as several may fit.
    """
    found = set()
    for group, rows in support.alike(asked):
        acting = [rows[k].anchors[0] for k in touching_rows(rows)]
        found |= {asked_anchor(one, group[0].order, asked) for one in acting if one.frame in MIXED_FRAMES}
        found |= {WORLD for row in rows if row.anchors[0].along}
    return found


def _contradicting_message(item: _Acting) -> str:
    return (
        f"More than a third of {len(item.row.off_m)} demonstrations act {100 * item.row.way_off_m:.1f} cm or more from"
        f" where the others do (action {item.index + 1}, relative to {item.seen_from}): too far for noise. They do the"
        " task in several ways, were recorded in another frame, or follow an object that is not in the scenes."
    )


def _explained_message(item: _Acting) -> str:
    return (
        f"Where {len(item.row.off_m)} demonstrations act (action {item.index + 1}, relative to {item.seen_from}), they"
        f" are up to {100 * item.explained_m:.1f} cm from their center, and {item.by} explains it: this is no noise,"
        " and the center is wrong. Check the point of the hand that is recorded, calibration, scale and base"
        " frame; delete the recordings made otherwise. Send a place between objects as an object of its own."
    )


def _turned_message(item: _Acting) -> str:
    return (
        f"More than a third of {len(item.row.off_m)} demonstrations turn the held object by"
        f" {item.turn_off_deg:.0f} degrees more, or less, than the others (action {item.index + 1}), as if only some of"
        " them poured. Delete the wrong ones."
    )


def _two_turns_message(item: _Acting) -> str:
    return (
        f"Where {len(item.row.off_m)} demonstrations act (action {item.index + 1}), the hand is turned in two ways,"
        f" {item.two_turns_deg:.0f} degrees apart relative to {item.seen_from}. Check whether some have another model"
        " of the object, or other axes of the hand; delete the wrong ones."
    )


def _circle_message(item: _Acting) -> str:
    return (
        f"{len(item.row.off_m)} demonstrations act on several sides of {item.seen_from}, at one distance from it"
        f" (action {item.index + 1}). They follow its yaw, although the task's yaw_symmetry_deg declares it symmetric."
        " Correct this setting."
    )


def _unlike_most_message(item: _Acting) -> str:
    return (
        f"Where the hand acts (action {item.index + 1}), {len(item.row.off_m)} demonstrations scatter by"
        f" {100 * item.row.scatter_m:.1f} cm relative to {item.seen_from}, but most of them agree relative to another"
        " object. Delete the others, or correct the names of their objects."
    )


def _scattered_finding(scattered: Sequence[_Acting]) -> Finding:
    missed = [item for item in scattered if not item.loosely and MISSED.severity(item.row.center_off_m) is not None]
    item = max(missed or scattered, key=lambda item: item.row.center_off_m)
    message = (
        f"{len(item.row.off_m)} demonstrations scatter by {100 * item.row.scatter_m:.1f} cm where the hand acts (action"
        f" {item.index + 1}, relative to {item.seen_from}), and their center may be {100 * item.row.center_off_m:.1f}"
        " cm off. Check calibration and poses, send every object that the motion depends on, or record more."
    )
    return item.finding(MISSED if missed else SCATTERED, message, item.row.center_off_m)


def _apart(
    shown: Sequence[Demonstration], row: PlanRow, k: int, tilted: frozenset[str], round_objects: frozenset[str]
) -> tuple[float, float]:
    """Return the scatter of places (m) and of rotations (degrees) along the axes of row `k`, if other axes fit better.

    0 where no others do. Place and hand then need different axes, and the demonstrations are too few or too noisy to
    choose them separately.
    """
    names = {anchor.object_name for anchor in row.anchors}
    poses = [item.object(anchor.object_name) for item, anchor in zip(shown, row.anchors, strict=True) if all(names)]
    if len(poses) < MIN_TURNED or names & round_objects or any(pose.quaternion_xyzw is None for pose in poses):
        return 0.0, 0.0
    world_m, own_m = (scatter_m[:, k] for scatter_m in scatters_m(shown, row.anchors, tilted))
    turn = np.array([row.anchors[0].place_turns, row.anchors[0].hand_turns])
    off_m, other_m = np.where(turn, own_m, world_m), np.where(turn, world_m, own_m)
    place_m, hand_m = np.where(much_less(other_m, off_m, APART_SHARES), off_m, 0.0).tolist()
    if row.anchors[0].frame == "ow":  # no noise of poses turns the hand in the world: it follows something else
        hand_m = max(hand_m, float(world_m[1]))
    return place_m, math.degrees(hand_m / M_PER_RAD)


def _two_turns_deg(row: PlanRow, round_objects: frozenset[str]) -> float:
    """Return the angle between two clusters of the hand's rotations; 0 where they are one, or the object is round."""
    only_turns = replace(row, offsets_m=np.zeros_like(row.offsets_m), center_m=np.zeros(3))
    least_m = M_PER_RAD * math.radians(TURNED_IN_TWO.levels["danger"])
    ways = None if row.anchors[0].object_name in round_objects else two_ways(only_turns, least_m=least_m)
    if ways is None:
        return 0.0
    return math.degrees((row.rotations[ways].mean().inv() * row.rotations[~ways].mean()).magnitude())


def _on_a_circle_m(row: PlanRow, round_objects: frozenset[str]) -> float:
    """Return the scatter of offsets that lie on a circle about a round object's vertical axis; else 0."""
    if row.anchors[0].object_name not in round_objects:
        return 0.0
    radii_m = np.linalg.norm(row.offsets_m[:, :2], axis=1)
    off_circle_m = float(np.median(np.abs(radii_m - np.median(radii_m))))
    return row.scatter_m if off_circle_m < CIRCLE_SHARE * row.scatter_m else 0.0


def _seen_from(row: PlanRow, shown: Order, asked: Order) -> str:
    anchor = asked_anchor(row.anchors[0], shown, asked)
    return anchor.object_name or f"the {anchor.frame}"


# Causes of scatter; the first that applies is reported
DOUBTS: tuple[tuple[Rule, Callable[[_Acting], float], Callable[[_Acting], str]], ...] = (
    (APART, lambda item: item.apart_m, _apart_message),
    (HAND_APART, lambda item: item.hand_apart_deg, _hand_apart_message),
    (CONTRADICTING, lambda item: item.row.way_off_m, _contradicting_message),
    (EXPLAINED_AWAY, lambda item: item.explained_m, _explained_message),
    (UNLIKE_MOST, lambda item: item.unlike_most_m, _unlike_most_message),
    (TURNED_OTHERWISE, lambda item: item.turn_off_deg, _turned_message),
    (TURNED_IN_TWO, lambda item: item.two_turns_deg, _two_turns_message),
    (ON_A_CIRCLE, lambda item: item.on_a_circle_m, _circle_message),
)
