"""Read a sentence over several tasks as steps, each in the words of the task that does it, or refuse it.

Every word must have a role, as in the instruction of one task, and every step must be one that its task was taught with
objects of these kinds. A sentence with two meanings is refused.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, product

from app.pipeline.errors import UnfamiliarInstructionError
from app.pipeline.order.clause_parser import Accepted
from app.pipeline.order.clauses import DIRECT, INSTRUMENT, ParsedClause, is_placed_after_moving, needs_free_hand
from app.pipeline.order.descriptions import NounPhrase
from app.pipeline.order.noun_phrases import NounPhrases
from app.pipeline.order.order import Order
from app.pipeline.order.reading import closest
from app.pipeline.order.refusals import Refusal, question, refusal
from app.pipeline.order.sentences import Sentences, Unit, forms_of, wanted
from app.pipeline.order.space import Layout
from app.pipeline.order.verbs import CONTAINING, TOGETHER
from app.pipeline.order.vocabulary import ORDERING
from app.pipeline.order.words import is_question, normalized
from app.pipeline.steps import several
from app.pipeline.steps.skills import MAX_LISTED, PlanStep, Skill, TasksOfScene, tasks_nearest_to

MAX_STEPS = 24  # that one sentence asks for


def read_steps(
    instruction: str, scene: TasksOfScene, layout: Layout | None, others: Mapping[Skill, str] | None = None
) -> tuple[PlanStep, ...]:
    """Return the steps that the instruction asks for, in their order.

    Args:
        layout: where the objects are, for relations; None: unknown.
        others: further tasks, and why they cannot be used, for the refusal.

    Raises:
        UngroundedInstructionError, UnfamiliarInstructionError: if it is not clear; they name the part.
    """
    said = normalized(instruction)
    valid = tasks_nearest_to(said, scene.skills, others or {})
    if is_question(said):
        raise question(said).error(valid)
    found: list[tuple[PlanStep, ...]] = [(step,) for step in _literal(said, scene)]
    reader = _Reader(scene, NounPhrases(said, scene.lexicon, layout))
    found = found or reader.read()
    if len(found) == 1 and len(found[0]) <= MAX_STEPS:
        return found[0]
    raise reader.refusal(found).error(valid)


def _literal(said: str, scene: TasksOfScene) -> list[PlanStep]:
    """Return the steps of all tasks that know the text, if one of them knows it as a whole only.

    One task says as a whole what another says in a clause: both may be meant.
    """
    objects = Order(said, scene.names).objects
    alike = [skill.literal(said) for skill in scene.skills if Order(said, skill.taught.names).objects == objects]
    known = list(filter(None, alike))
    return [step for step, _ in known] if any(is_whole for _, is_whole in known) else []


class _Reader:
    def __init__(self, scene: TasksOfScene, phrases: NounPhrases) -> None:
        self._scene = scene
        self._phrases = phrases
        self._known: dict[ParsedClause, list[tuple[PlanStep, ...]]] = {}
        self._missed = (-1, "")  # the number of parts before the one that is not understood, and why it is not

    def read(self) -> list[tuple[PlanStep, ...]]:
        """Return the meanings, each a sequence of steps; at most `MAX_LISTED`."""
        verbs, fixed, _ = self._scene.accepted
        accepted = Accepted(verbs, (fixed or frozenset()) | several.TIMES_WORDS, of_steps=True)
        sentences = Sentences(self._phrases, accepted)
        found: dict[tuple[PlanStep, ...], None] = {}
        every = (chain(self._wholes(units), self._of_units(units)) for units in sentences.units())
        for steps in chain.from_iterable(every):
            found[steps] = None
            if len(found) == MAX_LISTED:
                break
        return list(found)

    def refusal(self, found: Sequence[tuple[PlanStep, ...]]) -> Refusal:
        """Return why a sentence with no meaning or several, or with too many steps, is refused."""
        said = repr(self._phrases.text.instruction)
        if len(found) == 1:
            return Refusal(f"{said} asks for over {MAX_STEPS} steps: ask for fewer at once")
        if found:
            meanings = ["; ".join(f"{text!r} ({task})" for task, text in steps) for steps in found]
            return Refusal(f"{said} may mean {' or '.join(meanings)}: say which")
        if self._missed[1]:
            return Refusal(self._missed[1], UnfamiliarInstructionError)
        return refusal(self._scene, self._phrases, [])

    def _miss(self, place: int, unit: Unit, why: str) -> None:
        part = self._phrases.text.written(unit.start, unit.end)
        self._missed = max(self._missed, (place, f"the part {part!r} {why}"), key=lambda missed: missed[0])

    def _wholes(self, units: Sequence[Unit]) -> Iterator[tuple[PlanStep, ...]]:
        """Yield what one task was taught as a whole, as the only step; "before" or "except" would change it."""
        for clauses in (
            forms_of(units) if all(unit.mood == "do" and not unit.joined & ORDERING for unit in units) else ()
        ):
            for skill in self._scene.skills:
                yield from ((step,) for step in skill.whole(clauses))

    def _of_units(self, units: Sequence[Unit]) -> Iterator[tuple[PlanStep, ...]]:
        forbidden = {unit: self._choices(unit.clause) for unit in units if unit.mood == "not"}
        left_out = {step for choices in forbidden.values() for steps in choices for step in steps}
        done = wanted(several.without_excepted([unit for unit in units if not forbidden.get(unit)]))
        if several.is_unclear_what_is_forbidden(units):
            return
        order = several.order_of(done, units)
        if done and not order:
            self._miss(len(done), units[-1], 'leaves open what comes first: say it with "then"')
        clauses = self._resolved(done) if order else ()
        choices = self._choices_of(done, clauses)
        in_order = [clauses[place] for place in order] if choices else []
        if needs_free_hand(in_order):
            self._miss(len(done), units[-1], "needs a free hand: say first where to put what was picked up")
        elif is_placed_after_moving(in_order):
            self._miss(len(done), units[-1], "names an object by its place after another part moves one: use its name")
        elif in_order:
            every = (tuple(chain.from_iterable(parts)) for parts in product(*(choices[place] for place in order)))
            yield from (steps for steps in every if left_out.isdisjoint(steps))

    def _choices_of(self, done: Sequence[Unit], clauses: Sequence[ParsedClause]) -> list[list[tuple[PlanStep, ...]]]:
        choices = [self._choices(clause) for clause in clauses]
        for place in several.picked_up_to_put(done, clauses):
            choices[place] = [*choices[place], ()]
        for place, (unit, choice) in enumerate(zip(done, choices, strict=False)):
            if not choice:
                self._miss(place, unit, "is nothing that a task was taught to do with these objects")
                return []
        return choices

    def _resolved(self, units: Sequence[Unit]) -> tuple[ParsedClause, ...]:
        """Return the clauses with pronouns replaced by their objects; none if a pronoun is not clear."""
        found: list[ParsedClause] = []
        for place, unit in enumerate(units):
            clause = unit.clause
            if any(phrase.name is None for phrase in clause.phrases):
                meant = self._antecedent(clause, found[-1]) if found and unit.own_verb else ()
                if not meant:
                    self._miss(place, unit, "leaves open what 'it' or 'them' stands for: name the object")
                    return ()
                clause = clause.about(several.as_pronoun(meant))
            akin = any(several.is_akin(clause, other) for other in found)
            if several.counted(clause)[1] > 1 and unit.joined == {"and"} and akin:
                self._miss(place, unit, 'leaves open whether this part alone is repeated: begin it with "then"')
                return ()
            found.append(clause)
        return tuple(found)

    def _antecedent(self, clause: ParsedClause, before: ParsedClause) -> Sequence[NounPhrase]:
        """Return the objects of a pronoun: "it" is the one object of the clause before, or "it" there in this role.

        After "wipe the plate with the sponge and put it in the sink" it is the plate if no task puts the sponge there;
        after "put the mug in the drawer, then close it" the drawer if no task closes a mug; after "pour water from the
        can into the pot" the object for which a task exists. "Them" are several direct objects.
        """
        own = {phrase.name for phrase in clause.phrases}
        pronouns = {role: phrase for role, phrases in clause.roles for phrase in phrases if phrase.name is None}
        if len(pronouns) != 1 or any(len(clause.objects_in(role)) > 1 for role in pronouns):
            return ()  # "put it in it", "press it and the left button"
        ((at, pronoun),) = pronouns.items()
        if pronoun.plural:
            group = before.objects_in(DIRECT)
            return group if at == DIRECT and len(group) > 1 else ()
        found = {role: phrases[0] for role, phrases in before.roles if len(phrases) == 1 and phrases[0].name not in own}
        contains, with_tool = clause.verb in CONTAINING, found.keys() == {DIRECT, INSTRUMENT}
        if len(found) > 1 and at == DIRECT and (contains or with_tool or DIRECT not in found):
            done = {role: one for role, one in found.items() if self._choices(clause.about(several.as_pronoun([one])))}
            found = done if (DIRECT in done) == with_tool else {}
        elif (same := found.get(at)) is not None and same.by == several.IT:
            found = {at: same}
        return tuple(found.values()) if len(found) == 1 else ()

    def _choices(self, clause: ParsedClause) -> list[tuple[PlanStep, ...]]:
        if clause not in self._known:
            self._known[clause] = self._chosen(clause)
        return self._known[clause]

    def _chosen(self, clause: ParsedClause) -> list[tuple[PlanStep, ...]]:
        if clause.verb is None and len(clause.roles) < 2:
            return []  # "the red button" does not say what to do
        if whole := self._whole(clause):
            return [(step,) for step in whole]
        once, times = several.counted(clause)
        if times > 1:  # "both twice" does not say in which order
            return [steps * times for steps in self._choices(once) if len(steps) == 1]
        repeated = [role for role, phrases in clause.roles if len(phrases) > 1]
        to_both = repeated != [DIRECT] and clause.objects_in(DIRECT)  # one lid is not put on two pots
        if len(repeated) != 1 or to_both or clause.verb in TOGETHER:
            return []
        (role,) = repeated
        each = [clause.with_role(role, (phrase,)) for phrase in clause.objects_in(role)]
        return list(product(*map(self._whole, each)))

    def _whole(self, clause: ParsedClause) -> list[PlanStep]:
        """Return the single steps that a clause may ask for, preferring the taught verb to others of its family."""
        every = {filled: step for skill in self._scene.skills for filled, step in skill.steps(clause)}
        return list(dict.fromkeys(every[filled] for filled in closest(list(every))))
