"""Demonstrations that scatter where the hand acts: poses are noisy, or the motion follows something unknown."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.acting_row import ActingRow
from app.pipeline.findings.rules import Rule
from app.pipeline.groups import by_plan
from app.pipeline.order.order import Order
from app.pipeline.plans.acting import acting_rows, leads_on, switching_rows, touching_rows, turn_off_deg
from app.pipeline.plans.rows import plan_row
from app.pipeline.plans.support import Support
from app.pipeline.representation.anchors import asked_anchor

SCATTER_M = 0.01  # the least scatter of people and pose estimators
AT_AXIS_M = 0.01  # nearer to an object's vertical axis, all of its sides are at one place

Cause = tuple[Rule, float, str]
"""A rule, its value and the message: why a row scatters."""


def scatter_findings(
    support: Support,
    asked: Order,
    yaw_symmetry_deg: Mapping[str, float],
    undecided: Sequence[Demonstration] = (),
) -> Iterator[Finding]:
    """Yield at most one finding for demonstrations that scatter, or contradict each other, where the hand acts.

    Prompts show the robust center of the demonstrations, so that the standard error of the center counts. If more than
    a third of them are far from it, there is no common center, however many they are. Where the hand grasps or presses
    something, a standard error beyond the tolerance of a grasp is a danger.

    Args:
        undecided: demonstrations of several plans, between which nothing decides: they should act alike all the same,
            and each plan may have too few to show that some do not.
    """
    of_plans = [
        ActingRow(shown, rows, k, k in touching_rows(rows), asked, yaw_symmetry_deg)
        for shown, rows in support.alike(asked)
        for k in acting_rows(rows)
        if not leads_on(rows, k)
    ]
    across = list(_across_plans(undecided, asked, yaw_symmetry_deg))
    if causes := (*_worst(of_plans, _causes), *_worst(across, _no_common_center)):
        yield causes[0]
    elif scattered := [item for item in of_plans if item.row.scatter_m > SCATTER_M]:
        yield _scattered(scattered)


def _worst(acting: Sequence[ActingRow], causes_of: Callable[[ActingRow], Iterator[Cause]]) -> tuple[Finding, ...]:
    for causes in zip(*map(causes_of, acting), strict=True):
        (rule, value, message), item = max(zip(causes, acting, strict=True), key=lambda pair: pair[0][1])
        if rule.severity(value) is not None:
            return item.findings(rule, value, message)
    return ()


def _causes(item: ActingRow) -> Iterator[Cause]:
    yield from _wrong_axes(item)
    yield from _no_common_center(item)
    yield from _turned_otherwise(item)


def _across_plans(
    undecided: Sequence[Demonstration], asked: Order, yaw_symmetry_deg: Mapping[str, float]
) -> Iterator[ActingRow]:
    """Yield the switches of the gripper in all plans, seen from what they follow in the most usual one.

    Only their places can be compared: a plan may have the gripper turned by half a turn. Of an object that is declared
    symmetric each plan may take another side, so that places beside its axis cannot.
    """
    groups = sorted(by_plan(undecided), key=len, reverse=True)
    plans = Support.of(groups).plans if len(groups) > 1 else ()
    switches = [switching_rows(plan.rows) for plan in plans]
    shown = [
        replace(item, actions=tuple(item.actions[k] for k in own))
        for plan, own in zip(plans, switches, strict=True)
        for item in plan.demonstrations
    ]
    if len(plans) < 2 or len({tuple(action.gripper_open for action in item.actions) for item in shown}) > 1:
        return
    usual = [plans[0].rows[k] for k in switches[0]]
    followed = [[asked_anchor(row.anchors[0], plans[0].order, item.order) for item in shown] for row in usual]
    rows = [plan_row(shown, k, tuple(anchors)) for k, anchors in enumerate(followed)]
    for k, row in enumerate(usual):
        item = ActingRow(shown, rows, k, True, asked, yaw_symmetry_deg)
        if not item.is_round or np.linalg.norm(row.center_m[:2]) < AT_AXIS_M:
            yield item


def _wrong_axes(item: ActingRow) -> Iterator[Cause]:
    place_m, hand_deg = item.by_other_axes() if item.touches else (0.0, 0.0)
    turns = "does not turn" if item.row.anchors[0].place_turns else "turns"
    message = (
        f"The place where {item.text} probably {turns} with {item.seen_from}, unlike the hand: it may be"
        f" {200 * place_m:.1f} cm off. Record more demonstrations with {item.seen_from} at other angles, or send the"
        " place as an object of its own."
    )
    yield rules.SCATTER_OF_PLACES_BY_AXES, place_m, message
    turns = "does not turn" if item.row.anchors[0].hand_turns else "turns"
    message = (
        f"Where {item.text}, the hand probably {turns} with {item.seen_from}, unlike the place: it may be turned"
        f" wrongly by {2 * hand_deg:.0f} degrees. Record more demonstrations with {item.seen_from} at other angles."
    )
    yield rules.SCATTER_OF_HANDS_BY_AXES, hand_deg, message


def _no_common_center(item: ActingRow) -> Iterator[Cause]:
    off_m = item.row.way_off_m
    message = (
        f"Where {item.text}, more than a third are {100 * off_m:.1f} cm or more from where the others act: too far for"
        " noise. They do the task in several ways, were recorded in another frame, or follow an object that is not in"
        " the scenes. Delete the wrong ones, or send that object."
    )
    yield rules.SCATTER_OF_A_THIRD, off_m, message
    two_m = item.places_in_two_m()
    message = (
        f"Where {item.text}, they do so at two places, {100 * two_m:.1f} cm apart, and their center is at neither."
        " Check whether some have another tool, base frame or calibration; delete the wrong ones."
    )
    yield rules.SCATTER_OF_PLACES_IN_TWO, two_m, message
    beside_m = item.beside_core_m()
    message = (
        f"Where {item.text}, half agree closely, and more than a third are {100 * beside_m:.1f} cm or more from there:"
        " no noise does that. Check calibration, scale and base frame of the others; delete the wrong ones."
    )
    yield rules.SCATTER_BESIDE_A_CORE, beside_m, message
    explained_m, cause = item.explained_m()
    message = (
        f"Where {item.text}, they are up to {100 * explained_m:.1f} cm from their center, and {cause} explains it: this"
        " is no noise, and the center is wrong. Check the point of the hand that is recorded, calibration, scale and"
        " base frame; delete the recordings made otherwise. Send a place between objects as an object of its own."
    )
    yield rules.SCATTER_EXPLAINED, explained_m, message


def _turned_otherwise(item: ActingRow) -> Iterator[Cause]:
    turn_deg = 0.0 if item.touches else turn_off_deg(item.rows, item.index)
    message = (
        f"Where {item.text}, more than a third turn the held object by {turn_deg:.0f} degrees more, or less, than the"
        " others, as if only some of them poured. Delete the wrong ones."
    )
    yield rules.SCATTER_OF_TURN_OF_HELD, turn_deg, message
    two_deg = item.hands_in_two_deg() if item.touches else 0.0
    message = (
        f"Where {item.text}, the hand is turned in two ways, {two_deg:.0f} degrees apart. Check whether some have"
        " another model of the object, or other axes of the hand; delete the wrong ones."
    )
    yield rules.SCATTER_OF_HANDS_IN_TWO, two_deg, message
    message = (
        f"Where {item.text}, they act on several sides of it, at one distance. They follow its yaw, although the task's"
        " yaw_symmetry_deg declares it symmetric. Correct this setting."
    )
    yield rules.SCATTER_ON_A_CIRCLE, item.on_a_circle_m() if item.is_round else 0.0, message
    message = (
        f"Where {item.text}, they act on one side of it, at one distance, in several directions. They follow a yaw that"
        " was not sent. Send the object's rotation, or delete recordings in which it is wrong."
    )
    yield rules.SCATTER_ON_AN_ARC, item.on_an_arc_m(), message


def _scattered(scattered: Sequence[ActingRow]) -> Finding:
    touching = rules.SCATTER_OF_CENTER_AT_TOUCH
    exact = [item for item in scattered if not (item.loosely or item.ends_slide)]
    missed = [item for item in exact if touching.severity(item.row.center_off_m) is not None]
    item = max(missed or scattered, key=lambda item: item.row.center_off_m)
    message = (
        f"Where {item.text}, they scatter by {100 * item.row.scatter_m:.1f} cm, and their center may be"
        f" {100 * item.row.center_off_m:.1f} cm off. Check calibration and poses, send every object that the motion"
        " depends on, or record more demonstrations."
    )
    return item.findings(touching if missed else rules.SCATTER_OF_CENTER, item.row.center_off_m, message)[0]
