"""The skills of a task's demonstrations: one for each form of instruction, fitted when it is first asked for."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

from app.pipeline.episode import Query
from app.pipeline.order.order import Order
from app.pipeline.skill.fit import Plan
from app.pipeline.skill.recording import Recording
from app.pipeline.skill.scene import Scene
from app.pipeline.skill.skill import Skill, fit
from app.pipeline.skill.support import PlacedPlan, joined, placed_plan
from roboprompt_client.errors import InvalidInputError

MAX_STRUNG = 64  # combinations of the plans of several clauses


@dataclass(frozen=True, eq=False)
class Skills:
    """What recordings of a task show.

    Attributes:
        recordings: of all instructions, in the order of prompts.
        symmetry: degrees after which an object looks the same, by its name; 0 for a round one.
        knows_start: whether scenes tell where the hand starts; else no row follows that.
    """

    recordings: tuple[Recording, ...]
    symmetry: Mapping[str, float]
    knows_start: bool = True
    _fitted: dict[str, Skill] = field(default_factory=dict, init=False, repr=False)
    _few: dict[frozenset[str], "Skills"] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def forms(self) -> tuple[str, ...]:
        """The forms of instruction that recordings have, the most frequent first."""
        return tuple(form for form, _ in Counter(item.order.form for item in self.recordings).most_common())

    @property
    def instructions(self) -> tuple[str, ...]:
        """The instructions of the recordings."""
        return tuple(item.demonstration.instruction for item in self.recordings)

    def of(self, order: Order) -> Skill:
        """Return the skill that an instruction asks for.

        Where no recording has its form it is the most frequent one of as many clauses, or of any number.
        """
        return self.of_form(self._alike(order)[0])

    def of_form(self, form: str) -> Skill:
        """Return the skill of one of `forms`; fitted once."""
        if form not in self._fitted:
            alike = [item for item in self.recordings if item.order.form == form]
            self._fitted[form] = fit(alike, self.recordings, knows_start=self.knows_start)
        return self._fitted[form]

    def only(self, names: Collection[str]) -> "Skills":
        """Return the skills of scenes with only those objects that have these names; the last ones are kept."""
        key = frozenset(names)
        if key not in self._few:
            self._few.clear()
            self._few[key] = replace(self, recordings=tuple(item.only(names) for item in self.recordings))
        return self._few[key]

    @cached_property
    def without_start(self) -> "Skills":
        """The same for scenes that do not tell where the hand starts."""
        return replace(self, knows_start=False)

    @cached_property
    def needed(self) -> frozenset[str]:
        """The names of the objects that a scene must have: those that rows follow, words name, or ways depend on."""
        return frozenset(name for form in self.forms for name in _needed(self.of_form(form)))

    def scene(self, query: Query) -> Scene:
        """Return the scene of a query, symmetric objects turned to one side."""
        return Scene.of(query, self.symmetry)

    def plans_for(self, query: Query) -> tuple[Plan, ...]:
        """Return the plans that a query may be carried out by.

        They are of the skill of its instruction, or where no recording has its form, of all with as many clauses.
        """
        scene = self.scene(query)
        return tuple(plan for form in self._alike(query.order) for plan in self.of_form(form).plans_for(scene))

    def plans_shown(self, query: Query | None) -> tuple[Plan, ...]:
        """Return the plans that a prompt shows: those for a query, and the usual ones of other instructions."""
        scene = None if query is None else self.scene(query)
        found: list[Plan] = []
        for form in self.forms:
            skill = self.of_form(form)
            if not skill.aligned:
                found += skill.plans
            elif query is not None and scene is not None and query.order.form == form:
                found += skill.plans_for(scene)
            else:
                found.append(skill.usual[0])
        return tuple(found)

    def placed(self, query: Query) -> tuple[PlacedPlan, ...] | None:
        """Return the plans for a query, placed in its scene; None where recordings have other numbers of clauses.

        Where they carry out one clause each, the plans of several clauses are combined in their order, each in the
        scene that those before leave.

        Raises:
            InvalidInputError: if the plans combine in too many ways.
        """
        plans, clauses = self.plans_for(query), query.order.clauses
        number = len(plans[0].members[0].order.clauses)
        if number == len(clauses):
            return tuple(placed_plan(plan, query, self.scene(query)) for plan in plans)
        if number > 1:
            return None
        return tuple(self._strung(query))

    def _strung(self, query: Query) -> Iterator[PlacedPlan]:
        parts = [replace(query, instruction=clause.text) for clause in query.order.clauses]
        each = [self.plans_for(part) for part in parts]
        ways = list(product(*each))
        if len(ways) > MAX_STRUNG:
            message = f"has {len(parts)} clauses, whose demonstrated plans combine in {len(ways)} ways"
            raise InvalidInputError("instruction", message, f"at most {MAX_STRUNG} ways: fewer clauses at once")
        for way in ways:
            placed, before = [], None
            for plan, part in zip(way, parts, strict=True):
                scene = self.scene(part)
                scene = scene if before is None else replace(before, keys=scene.keys)
                placed.append(placed_plan(plan, part, scene))
                before = scene.after([row.action for row in placed[-1]])
            yield joined(placed)

    def _alike(self, order: Order) -> tuple[str, ...]:
        if order.form in self.forms:
            return (order.form,)
        as_long = {item.order.form for item in self.recordings if len(item.order.clauses) == len(order.clauses)}
        return tuple(form for form in self.forms if form in as_long) or self.forms


def _needed(skill: Skill) -> Iterator[str]:
    keys = {key for plan in skill.usual for row in plan.rows for key in row.frame.objects}
    keys |= {key for plan in skill.usual for condition in plan.when for key in condition.keys}
    for item in skill.recordings:
        order = item.order
        yield from order.objects
        yield from (pose.name for pose in item.demonstration.objects if order.placeholder(pose.name) in keys)
