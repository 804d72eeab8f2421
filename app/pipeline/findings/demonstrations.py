"""All demonstrations of a task, and the findings about those that ask for the same: contradictions and scatter."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import Finding, worst_severity
from app.pipeline.findings.demonstrated_scenes import MIN_AGREEING, ShownScenes
from app.pipeline.findings.frames import Compared
from app.pipeline.findings.gripper import dropping_findings, hand_findings
from app.pipeline.findings.hand import RecordedHand
from app.pipeline.findings.outliers import (
    answer_findings,
    elsewhere_findings,
    exchanged_findings,
    off_plans_m,
    prompt_findings,
)
from app.pipeline.findings.path_kept import path_findings
from app.pipeline.findings.places import MIN_DEMONSTRATIONS
from app.pipeline.findings.quaternion_order import objects_order_findings
from app.pipeline.findings.rules import SEVERAL_WAYS
from app.pipeline.findings.scatter import scatter_findings
from app.pipeline.findings.several_ways import ways_findings
from app.pipeline.findings.unmeasured import unmeasured_findings
from app.pipeline.findings.yaw import Rotations, turning_findings
from app.pipeline.groups import by_plan, grouped, shown_together, usual_ways
from app.pipeline.order.order import Order
from app.pipeline.order.vocabulary import PLACE_WORDS
from app.pipeline.plans.acting import acting_rows
from app.pipeline.plans.by_scene import Parting, parting
from app.pipeline.plans.support import PlacedPlan, Support
from app.pipeline.plans.ways import TWO_WAYS_M
from app.pipeline.representation.anchors import START, Anchor, asked_anchor
from app.pipeline.thresholds import BEYOND_NOISE_M
from roboprompt_client.types.poses import EndEffectorAction


@dataclass(frozen=True, eq=False)
class Taught:
    """A task's demonstrations, with which every answer is compared; what is derived from them is computed once.

    Attributes:
        demonstrations: as they were recorded, including those of plans that prompts leave out.
        several_ways: whether the task's setting `ways` is `several`.
        hands: the hand in each recording; empty where it is not known.
        yaw_symmetry_deg: declared, by object.
        given_xyzw: rotations of these objects before it was applied; None where not known.
        compared: objects with both a given pose and one found in images.
    """

    demonstrations: tuple[Demonstration, ...]
    several_ways: bool = False
    hands: tuple[RecordedHand, ...] = ()
    yaw_symmetry_deg: Mapping[str, float] = field(default_factory=dict)
    given_xyzw: Rotations | None = None
    compared: tuple[Compared, ...] = ()
    _restricted: dict[frozenset[str], "Taught"] = field(default_factory=dict, init=False, repr=False)
    _known: dict[tuple[str, int, tuple[str, ...]], tuple[Finding, ...]] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def usual(self) -> tuple[Demonstration, ...]:
        """The demonstrations that prompts show in some scene."""
        shown = {item.id for item in shown_together(self.demonstrations)}
        shown |= {item.id for form, group in self._alike.items() if self._parted[form] is not None for item in group}
        return tuple(item for item in self.demonstrations if item.id in shown)

    @cached_property
    def needed(self) -> frozenset[str]:
        """The names of the objects that a scene must have; others may be missing or new.

        All objects if there are few demonstrations, the instruction selects by place, or nothing known decides between
        several ways.
        """
        words = {word for form in self._alike for word in form.split()}
        undecided = any(
            len(usual_ways(alike)) > 1 if (parted := self._parted[form]) is None else parted.quantity.axis is None
            for form, alike in self._alike.items()
        )
        if len(self.demonstrations) < MIN_AGREEING or undecided or not PLACE_WORDS.isdisjoint(words):
            return frozenset(pose.name for item in self.demonstrations for pose in item.objects)
        return self.decisive

    @cached_property
    def decisive(self) -> frozenset[str]:
        """The objects that rows follow, words name or plans depend on, and those arranged with any of them."""
        found = set(self._followed_in_demonstrations)
        found |= {name for item in self.demonstrations for name in item.order.objects}
        parted = [item for item in self._parted.values() if item is not None]
        found |= {name for item in parted for name in (item.quantity.object_name, item.quantity.seen_from)}
        pairs = [{pair.one, pair.other} for pair in self.scenes.pairs]
        return frozenset(found.union(*(pair for pair in pairs if pair & found)) - {""})

    @cached_property
    def _followed_in_demonstrations(self) -> frozenset[str]:
        plans = self.support.plans
        return frozenset(name for _, rows in plans for row in rows for anchor in row.anchors for name in anchor.names)

    def of_objects(self, names: Collection[str]) -> "Taught":
        """Return the same with only these objects in the scenes; the last result is kept."""
        key = frozenset(names)
        if (found := self._restricted.get(key)) is None:
            found = replace(self, demonstrations=tuple(item.only(key) for item in self.demonstrations))
            self._restricted.clear()
            self._restricted[key] = found
        return found

    @cached_property
    def support(self) -> Support:
        """The plans of `usual`."""
        return Support.of(by_plan(self.usual))

    @cached_property
    def scenes(self) -> ShownScenes:
        """The places of their objects, and how near hands passed them."""
        return ShownScenes(self.usual, tuple(item for item in self.demonstrations if item not in self.usual))

    def findings(self, asked: Order) -> tuple[Finding, ...]:
        """Return the findings about the demonstrations that ask for the same, or about all if none does."""
        form, number = asked.form if asked.form in self._alike else "", len(asked.clauses)
        if (known := self._known.get((form, number, asked.objects))) is None:
            of_forms = tuple(self._of_forms(form))
            in_ways = self.several_ways or any(item.code == SEVERAL_WAYS.code for item in of_forms)
            one_way = form and not in_ways and self._parted[form] is None
            undecided = self._alike[form] if one_way else ()
            known = (
                *of_forms,
                *scatter_findings(self.support, asked, self.yaw_symmetry_deg, undecided),
                *turning_findings(self.support, asked, self.yaw_symmetry_deg, self.given_xyzw),
                *(dropping_findings(self.hands) if number > 1 and not form else ()),
                *objects_order_findings(self.demonstrations),
                *unmeasured_findings(
                    self.demonstrations, self._followed_in_demonstrations - self.yaw_symmetry_deg.keys()
                ),
            )
            self._known[form, number, asked.objects] = known
        return known

    def of_prompt(
        self, parts: Sequence[Query], plans: Mapping[str, Sequence[PlacedPlan] | None], shown_ids: Collection[str]
    ) -> Iterator[Finding]:
        """Yield a finding if a prompt that lacks some usual demonstrations implies other actions than all of them.

        Args:
            plans: by a part's instruction, those of the prompt, placed in the scene.
            shown_ids: of the demonstrations in the prompt.
        """
        for part in parts if self._lacks(shown_ids) else ():
            yield from prompt_findings(self.support, part, plans.get(part.instruction) or (), self.yaw_symmetry_deg)

    def _lacks(self, shown_ids: Collection[str]) -> bool:
        """Return whether a prompt leaves out demonstrations that prompts usually show."""
        return not self.several_ways and any(item.id not in shown_ids for item in self.usual)

    def of_answer(
        self, parts: Sequence[Query], actions: Sequence[EndEffectorAction], shown_ids: Collection[str]
    ) -> Iterator[Finding]:
        """Yield findings about an answer to all parts whose prompt shows only some of the demonstrations."""
        if self._lacks(shown_ids):
            for part in parts:
                yield from answer_findings(
                    self.support, part, actions, self.yaw_symmetry_deg if len(parts) == 1 else None
                )

    def followed(self, asked: Order) -> frozenset[str]:
        """Return the objects that rows of the requested motion are relative to."""
        return frozenset(name for anchor in self._anchors(asked) for name in anchor.names)

    def turning(self, asked: Order) -> frozenset[str]:
        """Return the objects whose own axes rows of the requested motion follow."""
        turning = (item for item in self._anchors(asked) if item.place_turns or item.hand_turns)
        return frozenset(anchor.object_name for anchor in turning if not anchor.toward)

    def follows_start(self, asked: Order) -> bool:
        """Return whether rows of the requested motion are relative to where the hand starts."""
        return START in self._anchors(asked)

    def _anchors(self, asked: Order) -> list[Anchor]:
        plans = self.support.alike(asked)
        if len(asked.clauses) > 1 and all(len(group[0].order.clauses) == 1 for group, _ in plans):
            return [anchor for part in asked.clauses for anchor in self._anchors(replace(asked, text=part.text))]
        return [asked_anchor(row.anchors[0], group[0].order, asked) for group, rows in plans for row in rows]

    @cached_property
    def _alike(self) -> dict[str, list[Demonstration]]:
        return grouped(self.demonstrations, attrgetter("order.form"))

    @cached_property
    def _parted(self) -> dict[str, Parting | None]:
        """What decides between the ways of each form of instruction; None where nothing does, or there is one way."""
        return {form: parting(alike) for form, alike in self._alike.items()}

    @cached_property
    def _off_plan_m(self) -> dict[Demonstration, float]:
        """How far each demonstration in `usual` acts from where the others of its plan do.

        Between switches of the gripper, rows of one number may show different stages, as after a detour: a
        demonstration that acts there in another row acts alike.
        """
        found: dict[Demonstration, float] = {}
        for group, rows in self.support.plans:
            acting, switches = acting_rows(rows), group[0].switches
            for i, demonstration in enumerate(group):
                off_m = max((float(rows[j].off_m[i]) for j in acting), default=0.0)
                at_switches_m = max((float(rows[j].off_m[i]) for j in switches), default=0.0)
                if at_switches_m < BEYOND_NOISE_M < off_m and off_plans_m(self.support, demonstration) < TWO_WAYS_M:
                    off_m = at_switches_m
                found[demonstration] = off_m
        return found

    def _off_m(self, item: Demonstration) -> float:
        if (shown_m := self._off_plan_m.get(item)) is not None:
            return shown_m
        return 0.0 if item.plan is None else off_plans_m(self.support, item)

    def _hands_of(self, demonstrations: Sequence[Demonstration]) -> list[RecordedHand]:
        hands = dict(zip(self.demonstrations, self.hands, strict=False))
        return [hands[item] for item in demonstrations if item in hands]

    def _of_forms(self, asked: str) -> Iterator[Finding]:
        """Yield findings for the requested instruction form, or for every form if it was not demonstrated."""
        for form in [asked] if asked else sorted(self._alike):
            alike = self._alike[form]
            off_m = [self._off_m(item) for item in alike]
            left_out = [item not in self._off_plan_m for item in alike]
            hands = self._hands_of(alike)
            yield from ways_findings(alike, hands, self.yaw_symmetry_deg, declared=self.several_ways)
            yield from () if self.several_ways else exchanged_findings(alike)
            yield from elsewhere_findings(alike, off_m, left_out, declared=self.several_ways)
            yield from path_findings([hand.kept for hand in hands])
            groups = (alike, *_of_ways(self._parted[form]))
            of_each = [tuple(hand_findings(group, self._hands_of(group))) for group in groups]
            yield from next((found for found in of_each if worst_severity(found) == "danger"), of_each[0])


def _of_ways(parted: Parting | None) -> list[list[Demonstration]]:
    """Return the demonstrations of each way between which the scene decides: all of one way may be wrong."""
    if parted is None:
        return []
    ways = [[parted.demonstrations[k] for k in np.flatnonzero(parted.ways == way)] for way in np.unique(parted.ways)]
    return [way for way in ways if len(way) >= MIN_DEMONSTRATIONS]
