"""What is doubtful about demonstrations of what is asked: they contradict each other, or scatter where it matters."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from app.pipeline.episode import Demonstration, Query
from app.pipeline.findings import Finding
from app.pipeline.findings.actions import ShownWays
from app.pipeline.findings.arrangement import FEWEST, rigid_pairs
from app.pipeline.findings.elsewhere import answer_findings, elsewhere_findings, exchanged_findings, from_shown_m
from app.pipeline.findings.hand import RecordedHand, path_findings
from app.pipeline.findings.implausible import dropping_findings, hand_findings, turning_findings
from app.pipeline.findings.places import ShownScenes
from app.pipeline.findings.scatter import scatter_findings
from app.pipeline.findings.sources import Compared
from app.pipeline.findings.ways import ways_findings
from app.pipeline.order.order import Order
from app.pipeline.order.vocabulary import PLACE_WORDS
from app.pipeline.plans import by_plan, shown_together, usual_ways
from app.pipeline.plans.by_scene import parting
from app.pipeline.plans.rows import acting_rows
from app.pipeline.plans.support import Support
from app.pipeline.representation.anchors import START, Anchor, asked_anchor
from roboprompt_client.types.poses import EndEffectorAction


@dataclass(frozen=True, eq=False)
class Taught:
    """A task's demonstrations, as far as an answer is held against all of them; everything is worked out once.

    Attributes:
        demonstrations: as they were recorded, also those of plans that prompts leave out.
        several_ways: whether somebody said that there are several ways of doing it.
        hands: of each, what its recording has; empty where that is not known.
        round_objects: whose yaw the task says means nothing, or little.
        moves: whether objects may be anywhere between what was demonstrated, as at a later step of a closed loop: then
            scenes and ways are not known.
        compared: poses of their objects that were given, and found in images as well.
    """

    demonstrations: tuple[Demonstration, ...]
    several_ways: bool = False
    hands: tuple[RecordedHand, ...] = ()
    round_objects: frozenset[str] = frozenset()
    moves: bool = False
    compared: tuple[Compared, ...] = ()
    _restricted: dict[frozenset[str], "Taught"] = field(default_factory=dict, init=False, repr=False)
    _known: dict[tuple[str, int, tuple[str, ...]], tuple[Finding, ...]] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def usual(self) -> tuple[Demonstration, ...]:
        """Those that prompts show in one scene or another."""
        shown = {item.id for item in shown_together(self.demonstrations)}
        shown |= {item.id for group in self._alike.values() if parting(group) is not None for item in group}
        return tuple(item for item in self.demonstrations if item.id in shown)

    @cached_property
    def needed(self) -> frozenset[str]:
        """The names of the objects that a scene must have; other objects may be missing, new or more.

        All where more cannot be known: of few demonstrations, where words decide by place, and where nothing known
        decides between ways.
        """
        words = {word for form in self._alike for word in form.split()}
        undecided = any(
            len(usual_ways(alike)) > 1 if (parted := parting(alike)) is None else parted.quantity.axis is None
            for alike in self._alike.values()
        )
        if len(self.demonstrations) < FEWEST or undecided or not PLACE_WORDS.isdisjoint(words):
            return frozenset(pose.name for item in self.demonstrations for pose in item.objects)
        return self.decisive

    @cached_property
    def decisive(self) -> frozenset[str]:
        """What rows follow, words name or parts plans; and what stood to one of these as one thing."""
        found = {anchor.object_name for _, rows in self.support.plans for row in rows for anchor in row.anchors}
        found |= {name for item in self.demonstrations for name in item.order.objects}
        for alike in self._alike.values():
            if (parted := parting(alike)) is not None:
                found |= {parted.quantity.object_name, parted.quantity.seen_from}
        pairs = [{pair.one, pair.other} for pair in rigid_pairs(self.usual)]
        return frozenset(found.union(*(pair for pair in pairs if pair & found)) - {""})

    def of_objects(self, names: Collection[str]) -> "Taught":
        """The same of scenes with these of the objects; the last is kept."""
        key = frozenset(names)
        if (found := self._restricted.get(key)) is None:
            found = replace(self, demonstrations=tuple(item.only(key) for item in self.demonstrations))
            self._restricted.clear()
            self._restricted[key] = found
        return found

    @cached_property
    def support(self) -> Support:
        """Their plans."""
        return Support.of(by_plan(self.usual))

    @cached_property
    def scenes(self) -> ShownScenes:
        """Where their objects are."""
        if self.moves:
            return ShownScenes(())
        return ShownScenes(self.usual, tuple(item for item in self.demonstrations if item not in self.usual))

    @cached_property
    def ways(self) -> ShownWays:
        """How near their hands come to objects."""
        return ShownWays(() if self.moves else self.usual)

    def findings(self, asked: Order) -> tuple[Finding, ...]:
        """What is doubtful about the demonstrations that ask for the same, or about all where none does."""
        form, number = asked.form if asked.form in self._alike else "", len(asked.clauses)
        if (known := self._known.get((form, number, asked.objects))) is None:
            scattered = scatter_findings(self.support, asked, self.round_objects)
            dropped = dropping_findings(self.hands) if number > 1 and not form else ()
            known = (*self._of_forms(form), *scattered, *turning_findings(self.support, asked), *dropped)
            self._known[form, number, asked.objects] = known
        return known

    def of_answer(
        self, parts: Sequence[Query], actions: Sequence[EndEffectorAction], shown_ids: Collection[str]
    ) -> Iterator[Finding]:
        """What is doubtful about an answer to the parts of an instruction if its prompt shows only these of them."""
        if not self.several_ways and not self.moves and any(item.id not in shown_ids for item in self.usual):
            for part in parts:
                yield from answer_findings(self.support, part, actions)

    def followed(self, asked: Order) -> frozenset[str]:
        """The objects that rows of the asked motion are relative to."""
        return frozenset(anchor.object_name for anchor in self._anchors(asked) if anchor.object_name)

    def follows_start(self, asked: Order) -> bool:
        """Whether rows of the asked motion are relative to where the hand starts."""
        return START in self._anchors(asked)

    def _anchors(self, asked: Order) -> list[Anchor]:
        plans = self.support.alike(asked)
        return [asked_anchor(row.anchors[0], group[0].order, asked) for group, rows in plans for row in rows]

    @cached_property
    def _alike(self) -> dict[str, list[Demonstration]]:
        found: dict[str, list[Demonstration]] = {}
        for demonstration in self.demonstrations:
            found.setdefault(demonstration.order.form, []).append(demonstration)
        return found

    @cached_property
    def _shown_off_m(self) -> dict[int, float]:
        """By `id`, how far each demonstration that prompts show acts from where the others of its plan do."""
        return {
            id(demonstration): max((float(rows[j].off_m[i]) for j in acting_rows(rows)), default=0.0)
            for group, rows in self.support.plans
            for i, demonstration in enumerate(group)
        }

    def _off_m(self, item: Demonstration) -> float:
        """How far it acts from where the others do, or the plans that are shown instead of its own."""
        if (shown_m := self._shown_off_m.get(id(item))) is not None:
            return shown_m
        return 0.0 if item.plan is None else from_shown_m(self.support, item)

    @cached_property
    def _hands(self) -> dict[int, RecordedHand]:
        """By `id`, where it is known."""
        return {id(item): hand for item, hand in zip(self.demonstrations, self.hands, strict=False)}

    def _of_forms(self, asked: str) -> Iterator[Finding]:
        """Of the form that is asked for; of each where it is none of them."""
        for form in [asked] if asked else sorted(self._alike):
            alike = self._alike[form]
            off_m = [self._off_m(item) for item in alike]
            left_out = [id(item) not in self._shown_off_m for item in alike]
            yield from ways_findings(alike, self.round_objects, declared=self.several_ways)
            yield from () if self.several_ways else exchanged_findings(alike)
            yield from elsewhere_findings(alike, off_m, left_out, declared=self.several_ways)
            hands = [self._hands[id(item)] for item in alike if id(item) in self._hands]
            yield from path_findings([hand.kept for hand in hands])
            yield from hand_findings(alike, hands)
