"""Parse an instruction into an `Order` against the instructions that a task was taught, or refuse it.

Every word must have a role in a taught form. A refusal says which word has none, and lists what the task knows.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from app.pipeline.order.clauses import DIRECT, INSTRUMENT, ParsedClause, needs_free_hand, uses_moved_object
from app.pipeline.order.descriptions import MEANS, NounPhrase
from app.pipeline.order.frames import Frame
from app.pipeline.order.lexicon import Text
from app.pipeline.order.noun_phrases import NounPhrases
from app.pipeline.order.order import Grounding, Order
from app.pipeline.order.refusals import Refusal, question, refusal, unfamiliar_text, valid_instructions
from app.pipeline.order.sentences import Sentences
from app.pipeline.order.space import Layout
from app.pipeline.order.taught import TaughtWords
from app.pipeline.order.words import is_question, normalized

_JOINT = ", then "


def read(
    instruction: str, taught: TaughtWords, layout: Layout | None = None, *, allow_unfamiliar: bool = False
) -> Order:
    """Return the instruction as an `Order`: in a taught form, with objects by their names.

    Words that are spelled almost as known ones are unknown.

    Args:
        layout: the objects' positions, for relations such as "the left one"; None: relations are refused.
        allow_unfamiliar: accept an instruction unlike every taught one if it is clear which objects it names.

    Raises:
        UngroundedInstructionError: if a phrase matches no object or several.
        UnfamiliarInstructionError: if it is unlike every taught instruction, or has words without a role.
    """
    said = normalized(instruction)
    if is_question(said):
        raise question(said).error(valid_instructions(taught))
    if (literal := taught.literal(said)) is not None:
        return literal
    phrases = NounPhrases(said, taught.lexicon, layout)
    found = _meanings(taught, phrases)
    if len(found) == 1:
        return found[0]
    why = refusal(taught, phrases, [order.text for order in found], _part_of(taught, phrases))
    if not (allow_unfamiliar and why.is_unfamiliar):
        raise why.error(valid_instructions(taught))
    passed_on = unfamiliar_text(taught, phrases)
    if isinstance(passed_on, Refusal):
        raise passed_on.error(valid_instructions(taught))
    text, named = passed_on
    return Order(text, taught.names, _groundings(phrases, named), why.message)


def _groundings(phrases: NounPhrases, named: Sequence[NounPhrase]) -> tuple[Grounding, ...]:
    return tuple(
        Grounding(phrases.text.written(each.start, each.end), each.name, each.by) for each in named if each.name
    )


@dataclass(frozen=True, eq=False)
class FilledFrame:
    """A clause matched to a taught frame; `objects` maps each object of the frame to the one of the clause."""

    frame: Frame
    objects: Mapping[str, str]
    clause: ParsedClause

    @property
    def kind(self) -> object:
        """The frame's verb and roles, and the instruments and sources that the clause leaves out."""
        return self.frame.clause.signature, frozenset(self.objects.values()) - {p.name for p in self.clause.phrases}

    @property
    def unlike(self) -> tuple[bool, ...]:
        """Whether instrument, verb, fixed words and objects differ from the taught ones, the weightiest first."""
        taught, asked = self.frame.clause, self.clause
        return (
            len(taught.objects_in(INSTRUMENT)) != len(asked.objects_in(INSTRUMENT)),
            taught.verb != asked.verb,
            taught.fixed_phrases != asked.fixed_phrases,
            any(a != b for a, b in self.objects.items()),
        )


def _meanings(taught: TaughtWords, phrases: NounPhrases) -> list[Order]:
    sentences = Sentences(phrases, taught.accepted)
    found: dict[str, Order] = {}
    for forms in sentences.readings():
        plans = (compounds(taught, form) or dict(_sequences(taught, form, phrases.text)) for form in forms)
        for text, plan in next(filter(None, plans), {}).items():
            named = {phrase for filled in plan for phrase in filled.clause.phrases}
            groundings = _groundings(phrases, sorted(named, key=lambda phrase: phrase.start))
            said = Order(phrases.text.instruction, taught.names)
            order = Order(text, taught.names, groundings or taught.named_in(said))
            found[text] = min(found.get(text, order), order, key=_uncertainty)
    return list(found.values())


def _uncertainty(order: Order) -> tuple[int, int]:
    return max((MEANS.index(each.by) for each in order.phrases), default=0), -len(order.phrases)


def compounds(taught: TaughtWords, reading: Sequence[ParsedClause]) -> dict[str, tuple[FilledFrame, ...]]:
    """Return the reading's clauses matched to compounds, by the canonical text; of alike compounds the closest one."""
    every = [
        (compound, tuple(map(FilledFrame, compound.frames, filled, reading)))
        for compound in taught.compounds
        if (filled := compound.filled(reading, taught.names))
    ]
    alike: dict[object, tuple[str, tuple[FilledFrame, ...]]] = {}
    for compound, plan in sorted(every, key=lambda each: [filled.unlike for filled in each[1]]):
        objects = {mine: other for filled in plan for mine, other in filled.objects.items()}
        if text := compound.text_for(objects, taught.names):
            alike.setdefault(tuple(filled.kind for filled in plan), (text, plan))
    return dict(alike.values())


def _part_of(taught: TaughtWords, phrases: NounPhrases) -> str:
    """Return the compound of which the instruction asks for a part only; empty if there is none."""
    if not taught.compounds:
        return ""
    readings = [form for forms in Sentences(phrases, taught.accepted).readings() for form in forms]
    return next((each.text for each in taught.compounds for form in readings if each.has(form, taught.names)), "")


def _sequences(
    taught: TaughtWords, reading: Sequence[ParsedClause], said: Text
) -> Iterator[tuple[str, tuple[FilledFrame, ...]]]:
    """Yield the reading's clauses matched to frames that may each stand alone, and the canonical text."""
    per_clause = [_choices(taught, clause) for clause in reading]
    for choice in product(*per_clause):
        said.count_step()
        plan = tuple(filled for part in choice for filled in part)
        clauses = [filled.clause for filled in plan]
        if uses_moved_object(clauses) or needs_free_hand(clauses):
            continue
        if text := _canonical(taught, plan):
            yield text, plan


def _choices(taught: TaughtWords, clause: ParsedClause) -> list[tuple[FilledFrame, ...]]:
    """Return the alternatives that a clause may ask for, each as matched frames: "red and blue" is two in sequence."""
    if whole := _best(taught, clause):
        return [(filled,) for filled in whole]
    objects = clause.objects_in(DIRECT)
    if len(objects) < 2 or len(clause.roles) > 1:
        return []
    parts = [_best(taught, clause.with_role(DIRECT, (phrase,))) for phrase in objects]
    return list(product(*parts)) if all(parts) else []


def _best(taught: TaughtWords, clause: ParsedClause) -> list[FilledFrame]:
    every = [
        FilledFrame(frame, objects, clause)
        for frame in taught.frames
        if frame.may_stand_alone and (objects := frame.filled(clause, taught.names)) is not None
    ]
    by_kind: dict[object, FilledFrame] = {}
    for filled in sorted(closest(every), key=lambda filled: filled.unlike):
        by_kind.setdefault(filled.kind, filled)
    return list(by_kind.values())


def closest(every: list[FilledFrame]) -> list[FilledFrame]:
    """Keep the matches that differ least, see `FilledFrame.unlike`, whatever their objects."""
    least = min((filled.unlike[:-1] for filled in every), default=())
    return [filled for filled in every if filled.unlike[:-1] == least]


def _canonical(taught: TaughtWords, plan: Sequence[FilledFrame]) -> str:
    *texts, last = [filled.frame.text_for(filled.objects, taught.names) for filled in plan]
    return _JOINT.join([*(text.rstrip(". ") for text in texts), last]) if last and all(texts) else ""
