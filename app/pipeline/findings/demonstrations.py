"""What is doubtful about demonstrations of what is asked: they contradict each other, or scatter where it matters."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.actions import ShownWays
from app.pipeline.findings.places import ShownScenes
from app.pipeline.findings.rules import CONTRADICTING, SCATTERED, SEVERAL_WAYS
from app.pipeline.order.order import Order
from app.pipeline.plans import Group, by_plan, is_decided, shown_together, usual_ways
from app.pipeline.plans.agreement import two_ways
from app.pipeline.plans.by_scene import parting
from app.pipeline.plans.rows import PlanRow, acting_rows, plan_rows
from app.pipeline.plans.support import Support, asked_anchor

SCATTER_M = 0.01  # what people and pose estimators do at their best


@dataclass(frozen=True, eq=False)
class Taught:
    """A task's demonstrations, as far as an answer is held against all of them; everything is worked out once.

    Attributes:
        demonstrations: as they were recorded, also those of plans that prompts leave out.
        several_ways: whether somebody said that there are several ways of doing it.
    """

    demonstrations: tuple[Demonstration, ...]
    several_ways: bool = False

    @cached_property
    def usual(self) -> tuple[Demonstration, ...]:
        """Those that prompts show in one scene or another."""
        shown = {item.id for item in shown_together(self.demonstrations)}
        shown |= {item.id for group in self._alike.values() if parting(group) is not None for item in group}
        return tuple(item for item in self.demonstrations if item.id in shown)

    @cached_property
    def support(self) -> Support:
        """Their plans."""
        return Support.of(by_plan(self.usual))

    @cached_property
    def scenes(self) -> ShownScenes:
        """Where their objects are."""
        return ShownScenes(self.usual)

    @cached_property
    def ways(self) -> ShownWays:
        """How near their hands come to objects."""
        return ShownWays(self.usual)

    def findings(self, asked: Order) -> tuple[Finding, ...]:
        """What is doubtful about the demonstrations that ask for the same, or about all where none does."""
        return self._of(asked).findings

    def followed(self, asked: Order) -> frozenset[str]:
        """The objects that rows of the asked motion are relative to."""
        return self._of(asked).followed

    def _of(self, asked: Order) -> "_Asked":
        form = asked.form if asked.form in self._alike else ""
        if (known := self._known.get((form, asked.objects))) is None:
            findings = (*self._ways_findings(form), *scatter_findings(self.support, asked))
            known = self._known[form, asked.objects] = _Asked(findings, _followed(self.support, asked))
        return known

    @cached_property
    def _known(self) -> dict[tuple[str, tuple[str, ...]], "_Asked"]:
        return {}

    @cached_property
    def _alike(self) -> dict[str, list[Demonstration]]:
        """By form of instruction."""
        found: dict[str, list[Demonstration]] = {}
        for demonstration in self.demonstrations:
            found.setdefault(demonstration.order.form, []).append(demonstration)
        return found

    def _ways_findings(self, form: str) -> Iterator[Finding]:
        for taught in sorted(self._alike) if not form else [form]:
            yield from ways_findings(self._alike[taught], declared=self.several_ways)


@dataclass(frozen=True)
class _Asked:
    """What demonstrations say of one thing that is asked for: their doubts, and the objects that rows follow."""

    findings: tuple[Finding, ...]
    followed: frozenset[str]


def _followed(support: Support, asked: Order) -> frozenset[str]:
    plans = support.alike(asked)
    anchors = [asked_anchor(row.anchors[0], group[0].order, asked) for group, rows in plans for row in rows]
    return frozenset(anchor.object_name for anchor in anchors if anchor.object_name)


def ways_findings(alike: Sequence[Demonstration], *, declared: bool) -> Iterator[Finding]:
    """Demonstrations of one instruction that go several ways, where neither words nor scene tell which.

    A fault of half of the recordings looks like this: another base frame, an inverted gripper.

    Args:
        alike: that ask for the same.
        declared: whether the task says that there are several ways.
    """
    ways = [] if is_decided(alike) or parting(alike) is not None else _acting_otherwise(usual_ways(alike))
    if len(ways) < 2:
        return
    numbers = " and ".join(str(len(way)) for way in ways)
    message = (
        f"{numbers} demonstrations of {alike[0].instruction!r} do it in different ways, and neither words nor scene"
        " tell which to take."
    )
    if not declared:
        message += (
            " Were some recorded with another base frame or an inverted gripper? Delete what is wrong; where all are"
            ' right, set the task\'s "ways" to "several".'
        )
    yield SEVERAL_WAYS.finding(message, "demonstrations", {"num_ways": len(ways)}, value=0.0 if declared else 1.0)


def _acting_otherwise(ways: Sequence[Group]) -> list[Group]:
    """The ways, of those that differ only in how the hand gets there one: they are together one way."""
    found: list[Group] = []
    for way in ways:
        same = next((k for k, other in enumerate(found) if _act_alike(other, way)), None)
        if same is None:
            found.append(way)
        else:
            found[same] += way
    return found


def _act_alike(one: Group, other: Group) -> bool:
    """Whether the demonstrations do the same with the gripper, and act in one place."""
    if _gripper(one[0]) != _gripper(other[0]) or len(one[0].actions) != len(other[0].actions):
        return False
    rows = plan_rows([*one, *other])
    return all(
        two_ways(rows[k]) is None and CONTRADICTING.severity(rows[k].way_off_m) is None for k in acting_rows(rows)
    )


def _gripper(demonstration: Demonstration) -> list[bool]:
    return [action.gripper_open for action in demonstration.actions]


def scatter_findings(support: Support, asked: Order) -> Iterator[Finding]:
    """Where the hand acts, demonstrations that scatter say that poses are noisy, or that they contradict each other.

    Prompts show the demonstrations' centre, so that what counts is how far that is likely to be off. Where more than a
    third of them are far from it there is none, and the number of demonstrations makes up for nothing.
    """
    acting = [(shown[0].order, k, rows[k]) for shown, rows in support.alike(asked) for k in acting_rows(rows)]
    if not acting:
        return
    order, k, row = max(acting, key=lambda item: item[2].way_off_m)
    if CONTRADICTING.severity(row.way_off_m) is not None:
        message = (
            f"More than a third of {len(row.off_m)} demonstrations are {100 * row.way_off_m:.1f} cm or more from where"
            f" the others act (action {k + 1}, seen from {_seen_from(row, order, asked)}): no noise does that. They do"
            " it in several ways, were recorded in another frame, or what they follow is not among the objects."
        )
        yield CONTRADICTING.finding(message, f"actions[{k}]", _numbers(row), value=row.way_off_m)
        return
    scattered = [item for item in acting if item[2].scatter_m > SCATTER_M]
    if scattered:
        order, k, row = max(scattered, key=lambda item: item[2].centre_off_m)
        message = (
            f"{len(row.off_m)} demonstrations scatter by {100 * row.scatter_m:.1f} cm where the hand acts (action"
            f" {k + 1}, seen from {_seen_from(row, order, asked)}), and their centre may be"
            f" {100 * row.centre_off_m:.1f} cm off: poses are noisy, or what it follows is not among the objects."
        )
        yield SCATTERED.finding(message, f"actions[{k}]", _numbers(row), value=row.centre_off_m)


def _seen_from(row: PlanRow, shown: Order, asked: Order) -> str:
    anchor = asked_anchor(row.anchors[0], shown, asked)
    return anchor.object_name or f"the {anchor.frame}"


def _numbers(row: PlanRow) -> dict[str, float]:
    return {"scatter_m": row.scatter_m, "way_off_m": row.way_off_m, "centre_off_m": row.centre_off_m}
