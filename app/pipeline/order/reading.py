"""An instruction is read: every word finds its place in what the task was taught, or the instruction is refused."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product

from app.pipeline.errors import UnfamiliarInstructionError
from app.pipeline.order.clauses import DIRECT, INSTRUMENT, ParsedClause
from app.pipeline.order.descriptions import MEANS
from app.pipeline.order.noun_phrases import NounPhrase, NounPhrases, TooInvolvedError
from app.pipeline.order.order import Grounding, Order
from app.pipeline.order.refusals import passed_on, refusal
from app.pipeline.order.sentences import Sentences
from app.pipeline.order.space import Layout
from app.pipeline.order.taught import Frame, Taught
from app.pipeline.order.verbs import PICKING

MAX_READINGS = 64  # that are compared; an instruction with more is ambiguous
_JOINT = ", then "


def read(instruction: str, taught: Taught, layout: Layout | None = None, *, allow_unfamiliar: bool = False) -> Order:
    """The instruction as it is understood.

    Args:
        layout: where the objects are, for relations.
        allow_unfamiliar: let pass what is unlike every taught instruction, if its objects are clear.

    Raises:
        UngroundedInstructionError: if a phrase stands for no object or for several.
        UnfamiliarInstructionError: if it is unlike every taught instruction, or has words that nothing explains.
    """
    if (literal := taught.literal(instruction)) is not None:
        return literal
    phrases = NounPhrases(instruction, taught.lexicon, layout)
    found = _meanings(taught, phrases)
    if len(found) == 1:
        return found[0]
    error = refusal(taught, phrases, [order.text for order in found])
    if not allow_unfamiliar or not isinstance(error, UnfamiliarInstructionError):
        error.choices = taught.choices
        raise error
    text, named = passed_on(taught, phrases)
    return taught.order(text, _groundings(phrases, named), error.message)


def _groundings(phrases: NounPhrases, named: Sequence[NounPhrase]) -> tuple[Grounding, ...]:
    """What each phrase was taken for."""
    found = [phrase for phrase in named if phrase.name is not None]
    return tuple(Grounding(phrases.text_of(each.start, each.end), each.name, each.by) for each in found if each.name)


@dataclass(frozen=True, eq=False)
class Filled:
    """A clause as a frame has it: by the objects of the frame those of the clause."""

    frame: Frame
    objects: Mapping[str, str]
    clause: ParsedClause


def _meanings(taught: Taught, phrases: NounPhrases) -> list[Order]:
    """Every different thing that the instruction may ask for."""
    sentences = Sentences(phrases, taught.fixed_words, taught.verbs)
    found: dict[str, Order] = {}
    try:
        for forms in islice(sentences.readings(), MAX_READINGS):
            for plan in next(filter(None, (list(_plans(taught, form)) for form in forms)), []):
                if (text := _canonical(taught, plan)) is not None:
                    named = {phrase for filled in plan for phrase in filled.clause.phrases}
                    groundings = _groundings(phrases, sorted(named, key=lambda phrase: phrase.start))
                    order = taught.order(text, groundings or taught.mentioned(phrases.instruction))
                    found[text] = min(found.get(text, order), order, key=_uncertainty)
    except TooInvolvedError:
        return []
    return list(found.values())


def _uncertainty(order: Order) -> tuple[int, int]:
    """Less for readings that guess less."""
    return max((MEANS.index(each.by) for each in order.phrases), default=0), -len(order.phrases)


def _plans(taught: Taught, reading: Sequence[ParsedClause]) -> Iterator[tuple[Filled, ...]]:
    """The reading in frames that were taught one after the other, or each on its own."""
    per_clause = [_choices(taught, clause) for clause in reading]
    for choice in islice(product(*per_clause), MAX_READINGS):
        plan = tuple(filled for part in choice for filled in part)
        signatures = tuple(filled.frame.clause.signature for filled in plan)
        alone = all(filled.frame.may_stand_alone for filled in plan)
        if any(signatures == frame.plan for frame in taught.frames) or (alone and not _wants_moved(plan)):
            yield plan


def _choices(taught: Taught, clause: ParsedClause) -> list[tuple[Filled, ...]]:
    """The frames of a clause, one for each thing that it may ask for; "red and blue" is asked one by one."""
    if whole := _best(taught, clause):
        return [(filled,) for filled in whole]
    objects = clause.objects_in(DIRECT)
    if len(objects) < 2 or len(clause.roles) > 1:
        return []
    parts = [_best(taught, replace(clause, roles=((DIRECT, (phrase,)),))) for phrase in objects]
    return list(product(*parts)) if all(parts) else []


def _best(taught: Taught, clause: ParsedClause) -> list[Filled]:
    """The clause as frames have it, one for each thing that it may ask for: with the objects that were taught first."""
    every = [
        Filled(frame, objects, clause)
        for frame in taught.frames
        if (objects := frame.filled(clause, taught.names)) is not None
    ]
    by_signature: dict[object, Filled] = {}
    for filled in sorted(closest(every), key=lambda filled: any(a != b for a, b in filled.objects.items())):
        by_signature.setdefault(filled.frame.clause.signature, filled)
    return list(by_signature.values())


def closest(every: list[Filled]) -> list[Filled]:
    """Those with the clause's own instrument, verb and words, where some have them."""
    with_instrument = [
        each
        for each in every
        if len(each.frame.clause.objects_in(INSTRUMENT)) == len(each.clause.objects_in(INSTRUMENT))
    ]
    every = with_instrument or every
    every = [each for each in every if each.frame.clause.verb == each.clause.verb] or every
    return [each for each in every if each.frame.clause.fixed_phrases == each.clause.fixed_phrases] or every


def _canonical(taught: Taught, plan: Sequence[Filled]) -> str | None:
    texts = [filled.frame.text_for(filled.objects, taught.names) for filled in plan]
    known = [text for text in texts if text is not None]
    if len(known) < len(texts):
        return None
    return _JOINT.join([*(text.rstrip(". ") for text in known[:-1]), known[-1]])


def _wants_moved(plan: Sequence[Filled]) -> bool:
    """Whether an object is asked for again after it was taken elsewhere: only where it was seen is known.

    To pick it up twice is as it was said.
    """
    moved: set[str] = set()
    for k, filled in enumerate(plan):
        picks = filled.clause.verb in PICKING and len(filled.clause.roles) <= 1
        again = picks and k > 0 and filled.objects == plan[k - 1].objects and filled.frame is plan[k - 1].frame
        if not again and not moved.isdisjoint(phrase.name for phrase in filled.clause.phrases if phrase.name):
            return True
        if picks or filled.clause.takes_somewhere:
            moved |= {phrase.name for phrase in filled.clause.objects_in(DIRECT) if phrase.name}
    return False
