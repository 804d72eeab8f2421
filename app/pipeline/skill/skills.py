"""The skills of a task's demonstrations: one for each form of instruction, fitted when it is first asked for."""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, product
from typing import NamedTuple

import numpy as np

from app.pipeline.episode import Query
from app.pipeline.finding import Finding, without_repeats
from app.pipeline.names import folded_name
from app.pipeline.order.order import Order
from app.pipeline.skill import doubts
from app.pipeline.skill.fit import Plan
from app.pipeline.skill.recording import Recording
from app.pipeline.skill.scene import Scene
from app.pipeline.skill.script import expected
from app.pipeline.skill.skill import Skill, fit
from app.pipeline.skill.support import PlacedPlan, joined, placed_plan
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import EndEffectorAction

MAX_STRUNG = 64  # combinations of the plans of several clauses


class Off(NamedTuple):
    """How far an action is from where demonstrations do it; `follows`: what it is relative to, in words."""

    follows: str
    off_m: float
    off_deg: float


@dataclass(frozen=True, eq=False)
class Skills:
    """What recordings of a task show.

    Attributes:
        recordings: of all instructions, in the order of prompts.
        symmetry: degrees after which an object looks the same, by its name; 0 for a round one.
        names: of the objects, as the task spells them.
        knows_start: whether scenes tell where the hand starts; else no row follows that.
    """

    recordings: tuple[Recording, ...]
    symmetry: Mapping[str, float]
    names: tuple[str, ...] = ()
    knows_start: bool = True
    _fitted: dict[str, Skill] = field(default_factory=dict, init=False, repr=False)
    _few: dict[frozenset[str], "Skills"] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def forms(self) -> tuple[str, ...]:
        """The forms of instruction that recordings have, the most frequent first."""
        return tuple(form for form, _ in Counter(item.order.form for item in self.recordings).most_common())

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

    @cached_property
    def of_demonstrations(self) -> tuple[Finding, ...]:
        """The doubts that do not depend on a scene, of each form of instruction."""
        return self._each(self.of_form(form).of_demonstrations for form in self.forms)

    def of_orders(self, orders: Iterable[Order]) -> tuple[Finding, ...]:
        """Return those of the doubts about demonstrations that matter to instructions."""
        return self._each(self.of(order).of_demonstrations for order in orders)

    def of_scene(self, queries: Sequence[Query]) -> tuple[Finding, ...]:
        """Return the doubts about a scene in which several instructions are carried out."""
        known = [query for query in queries if query.order.form in self.forms]
        each = [self.of(query.order).of_scene(self.scene(query)) for query in known]
        return without_repeats(self._each(each))

    def _each(self, found: Iterable[Sequence[Finding]]) -> tuple[Finding, ...]:
        """Return each finding once, objects in `where` as the task spells them."""
        spelled = {f"objects[{folded_name(name)}]": f"objects[{name}]" for name in self.names}
        each: list[Finding] = []
        for one in chain.from_iterable(found):
            named = replace(one, where=spelled.get(one.where, one.where))
            each += [] if named in each else [named]
        return tuple(each)

    def of_way(self, queries: Sequence[Query], actions: Sequence[EndEffectorAction]) -> tuple[Finding, ...]:
        """Return the doubts about the way through actions that carry out these instructions, one after the other.

        Objects in the scene that demonstrations do not have are in the way, too.
        """
        if not actions:
            return ()
        named = [name for query in queries for name in query.order.objects]
        touched = {folded_name(name) for name in (*self.needed, *named)}
        scene = self.scene(queries[0])
        return self._each([list(doubts.of_way(scene, touched, actions, self.recordings))])

    def off(self, query: Query, actions: Sequence[EndEffectorAction]) -> tuple[Off, ...]:
        """Return how far each action is from its row; nothing where the rows are others, or cannot be told."""
        if query.order.form not in self.forms:
            return ()
        scene, skill = self.scene(query), self.of(query.order)
        if not skill.objects <= set(scene.keys):
            return ()
        plan = skill.plan_for(scene)
        if len(plan.rows) != len(actions):
            return ()
        seen = plan.as_shown(scene)
        each = [row.residual(action, seen) for row, action in zip(plan.rows, actions, strict=True)]
        return tuple(
            Off(plan.followed_by(k), float(np.linalg.norm(off[:3])), float(np.degrees(np.linalg.norm(off[3:]))))
            for k, off in enumerate(each)
        )

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

    def in_turn(self, asked: Sequence[Query]) -> Iterator[tuple[Query, tuple[PlacedPlan, ...] | None]]:
        """Yield queries that are carried out one after the other, each in the scene before it, with their placed plans.

        Of several plans of a query the first says how it leaves the scene.
        """
        left = None
        for given in asked:
            query = given if left is None else replace(given, objects=left.objects, start=left.start)
            plans = self.placed(query)
            yield query, plans
            left = self.left_by(query, plans[0]) if plans and plans[0] else query

    def left_by(self, query: Query, plan: PlacedPlan) -> Query:
        """Return a query in the scene that its plan leaves: what words say is put lies where the hand lets it go."""
        actions = [row.action for row in plan]
        start = None if query.start is None else actions[-1]
        opens = [k for k, action in enumerate(actions) if action.gripper_open]
        if not opens or not any(event.opens for event in expected(query.order)):
            return replace(query, start=start)
        left = self.scene(query).after(actions[: opens[-1] + 1])
        objects = [
            replace(pose, position_m=place, quaternion_xyzw=None if pose.quaternion_xyzw is None else turn)
            for pose, place, turn in zip(query.objects, left.place, left.turn, strict=True)
        ]
        return replace(query, objects=tuple(objects), start=start)

    def _strung(self, query: Query) -> Iterator[PlacedPlan]:
        parts = [replace(query, instruction=clause.text) for clause in query.order.clauses]
        each = [self.plans_for(part) for part in parts]
        ways = list(product(*each))
        if len(ways) > MAX_STRUNG:
            message = f"has {len(parts)} clauses, whose demonstrated plans combine in {len(ways)} ways"
            raise InvalidInputError("instruction", message, f"at most {MAX_STRUNG} ways: fewer clauses at once")
        for way in ways:
            placed, left = [], query
            for plan, part in zip(way, parts, strict=True):
                asked = replace(part, objects=left.objects, start=left.start)
                placed.append(placed_plan(plan, asked, self.scene(asked)))
                left = self.left_by(asked, placed[-1])
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
