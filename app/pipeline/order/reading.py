"""Parse an instruction into an `Order` against the instructions that a task was taught, or refuse it.

Every word must have a role in a taught form. A refusal says which word has none, and lists what the task knows.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, product

from app.pipeline.order.clauses import DIRECT, INSTRUMENT, ParsedClause, needs_free_hand, uses_moved_object
from app.pipeline.order.descriptions import MEANS, NounPhrase
from app.pipeline.order.lexicon import TooInvolvedError
from app.pipeline.order.noun_phrases import NounPhrases
from app.pipeline.order.order import Grounding, Order
from app.pipeline.order.refusals import Refusal, refusal, unfamiliar_text, valid_instructions
from app.pipeline.order.sentences import Sentences
from app.pipeline.order.space import Layout
from app.pipeline.order.taught import Frame, TaughtWords

MAX_READINGS = 64  # that are compared; an instruction with more is ambiguous
_JOINT = ", then "


def read(
    instruction: str, taught: TaughtWords, layout: Layout | None = None, *, allow_unfamiliar: bool = False
) -> Order:
    """Return the instruction as an `Order`: in a taught form, with objects by their names.

    Args:
        layout: the objects' positions, for relations such as "the left one"; None: relations are refused.
        allow_unfamiliar: accept an instruction unlike every taught one if it is clear which objects it names.

    Raises:
        UngroundedInstructionError: if a phrase matches no object or several.
        UnfamiliarInstructionError: if it is unlike every taught instruction, or has words without a role.
    """
    if (literal := taught.literal(instruction)) is not None:
        return literal
    phrases = NounPhrases(instruction, taught.lexicon, layout)
    found = _meanings(taught, phrases)
    if len(found) == 1:
        return found[0]

    def is_clear(text: str) -> bool:
        return bool(taught.literal(text)) or len(_meanings(taught, NounPhrases(text, taught.lexicon, layout))) == 1

    why = refusal(taught, phrases, [order.text for order in found], is_clear)
    if not (allow_unfamiliar and why.is_unfamiliar):
        raise why.error(valid_instructions(taught), taught.choices)
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


def _meanings(taught: TaughtWords, phrases: NounPhrases) -> list[Order]:
    sentences = Sentences(phrases, taught.accepted)
    found: dict[str, Order] = {}
    try:
        for forms in islice(sentences.readings(), MAX_READINGS):
            for plan in next(filter(None, (list(_plans(taught, form)) for form in forms)), []):
                if text := _canonical(taught, plan):
                    named = {phrase for filled in plan for phrase in filled.clause.phrases}
                    groundings = _groundings(phrases, sorted(named, key=lambda phrase: phrase.start))
                    said = Order(phrases.text.instruction, taught.names)
                    order = Order(text, taught.names, groundings or taught.named_in(said))
                    found[text] = min(found.get(text, order), order, key=_uncertainty)
    except TooInvolvedError:
        return []
    return list(found.values())


def _uncertainty(order: Order) -> tuple[int, int]:
    return max((MEANS.index(each.by) for each in order.phrases), default=0), -len(order.phrases)


def _plans(taught: TaughtWords, reading: Sequence[ParsedClause]) -> Iterator[tuple[FilledFrame, ...]]:
    """Yield the reading's clauses matched to frames that were taught in this sequence, or that may each stand alone."""
    per_clause = [_choices(taught, clause) for clause in reading]
    for choice in islice(product(*per_clause), MAX_READINGS):
        plan = tuple(filled for part in choice for filled in part)
        signatures = tuple(filled.frame.clause.signature for filled in plan)
        alone = all(filled.frame.may_stand_alone for filled in plan)
        clauses = [filled.clause for filled in plan]
        possible = alone and not uses_moved_object(clauses) and not needs_free_hand(clauses)
        if possible or any(signatures == frame.plan for frame in taught.frames):
            yield plan


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
    """Return the closest matching frame of each signature, preferring frames taught with the clause's own objects."""
    every = [
        FilledFrame(frame, objects, clause)
        for frame in taught.frames
        if (objects := frame.filled(clause, taught.names)) is not None
    ]
    by_signature: dict[object, FilledFrame] = {}
    said = {phrase.name for phrase in clause.phrases}
    for filled in sorted(closest(every), key=lambda filled: any(a != b for a, b in filled.objects.items())):
        added = frozenset(filled.objects.values()) - said  # instruments and sources that the clause leaves out
        by_signature.setdefault((filled.frame.clause.signature, added), filled)
    return list(by_signature.values())


def closest(every: list[FilledFrame]) -> list[FilledFrame]:
    """Keep the matches with the clause's instrument, then verb, then fixed words, each as far as there are any."""
    with_instrument = [
        each
        for each in every
        if len(each.frame.clause.objects_in(INSTRUMENT)) == len(each.clause.objects_in(INSTRUMENT))
    ]
    every = with_instrument or every
    every = [each for each in every if each.frame.clause.verb == each.clause.verb] or every
    return [each for each in every if each.frame.clause.fixed_phrases == each.clause.fixed_phrases] or every


def _canonical(taught: TaughtWords, plan: Sequence[FilledFrame]) -> str:
    """Return the taught texts with the clauses' objects; empty if one of them cannot be written."""
    *texts, last = [filled.frame.text_for(filled.objects, taught.names) for filled in plan]
    return _JOINT.join([*(text.rstrip(". ") for text in texts), last]) if last and all(texts) else ""
