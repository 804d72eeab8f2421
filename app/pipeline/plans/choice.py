"""Chooses the demonstrations that a prompt shows, by the plan that fits the scene, with findings that explain it."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import (
    FEW_DEMONSTRATIONS,
    LEFT_OUT,
    MANY_ROWS,
    NO_COMMON_PLAN,
    PLAN_OF_SCENE,
    SCENE_BETWEEN,
    SCENE_BEYOND,
)
from app.pipeline.groups import grouped, shown_together
from app.pipeline.plans.by_scene import BETWEEN, FAR, Parting, parting
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

MAX_WARMED = 4  # plans whose prompts a model reads ahead
FEW = 3  # least number of demonstrations that determine the anchor of a row
MAX_USUAL_ROWS = 20
COMMON_SHARE = 1 / 2
LISTED = 5  # demonstrations that a message names


@dataclass(frozen=True, eq=False)
class PlanChoice:
    """The demonstrations that a prompt shows.

    Attributes:
        findings: the reasons of the choice, and doubts about it.
    """

    shown: tuple[Demonstration, ...]
    findings: tuple[Finding, ...] = ()


class PlanChooser:
    """Chooses among demonstrations with aligned rows.

    The scene chooses the plan if equal instructions name the same objects in the same order and a quantity of the scene
    separates their plans (`by_scene`); otherwise every prompt shows the most frequent plan and others that are not
    rare.
    """

    def __init__(self, demonstrations: Sequence[Demonstration]) -> None:
        self._all = tuple(demonstrations)
        self._usual = shown_together(self._all)

    def __call__(self, objects: Sequence[ObjectPose]) -> PlanChoice:
        """Return the choice for a scene; without objects that of the way with most demonstrations."""
        chosen = [_chosen(parted, objects) if objects else (_usual(parted)[0], []) for parted in self._parted]
        choice = self._of_ways([way for way, _ in chosen])
        return replace(choice, findings=(*(found for _, findings in chosen for found in findings), *choice.findings))

    def likely(self) -> list[PlanChoice]:
        """Return the choices of the most frequent ways, most frequent first."""
        if not self._parted:
            return [self._of_ways([])]
        first, *others = self._parted
        return [self._of_ways([way, *(_usual(other)[0] for other in others)]) for way in _usual(first)[:MAX_WARMED]]

    def _of_ways(self, ways: Sequence[int]) -> PlanChoice:
        left_out = {d.id for d in self._never_shown}.union(*map(_not_of, ways, self._parted))
        shown = tuple(d for d in self._all if d.id not in left_out)
        return PlanChoice(shown, tuple(self._doubts(shown)))

    @cached_property
    def _parted(self) -> list[Parting]:
        """The separations of plans, one for each form of instruction that has one."""
        groups = grouped(self._all, attrgetter("order.form")).values()
        return [found for group in groups if (found := parting(group)) is not None]

    @cached_property
    def _never_shown(self) -> tuple[Demonstration, ...]:
        parted = {d.id for one in self._parted for d in one.demonstrations}
        usual = {d.id for d in self._usual}
        return tuple(d for d in self._all if d.id not in parted and d.id not in usual)

    def _doubts(self, shown: Sequence[Demonstration]) -> Iterator[Finding]:
        rows = max((len(demonstration.actions) for demonstration in shown), default=0)
        if len(shown) < FEW:
            message = (
                f"The prompt shows {len(shown)} demonstration{'s' if len(shown) > 1 else ''} of the plan: with fewer"
                f" than {FEW} it is not known what a row follows. Record more in scenes like this one."
            )
            numbers = {"demonstrations": len(shown)}
            yield FEW_DEMONSTRATIONS.finding(message, "demonstrations", numbers, value=_grasps_of_one(shown))
        if rows > MAX_USUAL_ROWS:
            message = f"The plan takes {rows} rows: the longer a reply, the more goes wrong."
            yield MANY_ROWS.finding(message, "demonstrations", {"rows": rows})
        if never := self._never_shown:
            yield from _left_out(never, len(self._all))


def _grasps_of_one(shown: Sequence[Demonstration]) -> int:
    """Return how often the hand closes in a single demonstration: each grasp may be of another object; else 0."""
    if len(shown) != 1:
        return 0
    return sum(not shown[0].actions[k].gripper_open for k in shown[0].switches)


def _usual(parted: Parting) -> list[int]:
    return [way for way, _ in Counter(parted.ways.tolist()).most_common()]


def _not_of(way: int, parted: Parting) -> set[str]:
    return {d.id for d, other in zip(parted.demonstrations, parted.ways, strict=True) if other != way}


def _chosen(parted: Parting, objects: Sequence[ObjectPose]) -> tuple[int, list[Finding]]:
    """Return the way of the most similar demonstrated scene, and findings about it."""
    quantity = parted.quantity
    value = quantity.of(objects)
    apart = quantity.apart(parted.values, value)
    way = int(parted.ways[apart.argmin()])
    own = parted.ways == way
    unit, off, other = quantity.unit, float(apart[own].min()), float(apart[~own].min())
    plan, plans = way + 1, int(parted.ways.max()) + 1
    numbers = {"plan": plan, "plans": plans, f"apart_{unit}": off, f"other_plan_{unit}": other}
    where = f"objects[{quantity.object_name}]" if quantity.object_name else "objects"
    if quantity.axis is None:
        here, shown = f"{quantity.text} are {_with_unit(off, unit)} from", f"those of {int(own.sum())} demonstrations"
    else:
        here = f"{quantity.text} is {_with_unit(float(value[0]), unit)}, near"
        shown = _range_text(parted.values[own], unit)
    message = f"Plan {plan} of {plans} is shown: {here} {shown}"
    far = off > max(FAR[unit], parted.near(way))
    if not far and off <= max(BETWEEN * other, parted.near(way)):
        return way, [PLAN_OF_SCENE.finding(f"{message}.", where, numbers)]
    message += (
        f", but {_with_unit(off, unit)} from the nearest of these; the nearest of another plan is"
        f" {_with_unit(other, unit)} away. Demonstrate in scenes like this one."
    )
    if far:
        return way, [SCENE_BEYOND.finding(message, where, numbers)]
    return way, [SCENE_BETWEEN.finding(message, where, numbers)]


def _left_out(never: Sequence[Demonstration], number: int) -> Iterator[Finding]:
    named = ", ".join(demonstration.id for demonstration in never[:LISTED])
    more = f" and {len(never) - LISTED} more" if never[LISTED:] else ""
    message = (
        f"{len(never)} of {number} demonstrations are not shown, since they are done in another way than most and"
        f" nothing in their scenes tells when: {named}{more}."
    )
    yield LEFT_OUT.finding(message, "demonstrations", {"left_out": len(never), "demonstrations": number})
    if number - len(never) <= COMMON_SHARE * number:
        message = (
            f"No more than half of the {number} demonstrations are carried out in the way that is shown: demonstrate it"
            " in one way, and send every object whose place decides between ways."
        )
        yield NO_COMMON_PLAN.finding(message, "demonstrations", {"demonstrations": number})


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.0f} degrees" if unit == "deg" else f"{100 * value:.1f} cm"


def _range_text(values_deg_or_m: Array, unit: str) -> str:
    values = values_deg_or_m[:, 0]
    if unit == "deg":
        middle = math.degrees(np.angle(np.exp(1j * np.radians(values)).mean()))
        values = middle + (values - middle + 180) % 360 - 180
    low, high = values.min(), values.max()
    return _with_unit(low, unit) if math.isclose(low, high) else f"{_with_unit(low, unit)} .. {_with_unit(high, unit)}"
