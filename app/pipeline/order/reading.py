"""Parse an instruction into an `Order` against the instructions that a task was taught, or refuse it.

Every word must have a role in a taught form. A refusal says which word has none, and lists what the task knows.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product

from app.pipeline.errors import InstructionError, UnfamiliarInstructionError, UngroundedInstructionError
from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.clauses import DIRECT, INSTRUMENT, ParsedClause, picks_with_full_hand
from app.pipeline.order.descriptions import MEANS
from app.pipeline.order.noun_phrases import NounPhrase, NounPhrases, TooInvolvedError, Unmatched
from app.pipeline.order.order import Grounding, Order, clause_of
from app.pipeline.order.sentences import Sentences
from app.pipeline.order.space import Layout
from app.pipeline.order.taught import Frame, Taught
from app.pipeline.order.words import Word

FIELD = "instruction"
MAX_READINGS = 64  # that are compared; an instruction with more is ambiguous
MAX_LISTED = 12  # instructions that a refusal repeats
_JOINT = ", then "


def read(instruction: str, taught: Taught, layout: Layout | None = None, *, allow_unfamiliar: bool = False) -> Order:
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
    error = refusal(taught, phrases, [order.text for order in found])
    if not allow_unfamiliar or not isinstance(error, UnfamiliarInstructionError):
        error.choices = taught.choices
        raise error
    text, named = _passed_on(taught, phrases)
    return taught.order(text, _groundings(phrases, named), error.message)


def _groundings(phrases: NounPhrases, named: Sequence[NounPhrase]) -> tuple[Grounding, ...]:
    return tuple(Grounding(phrases.text_of(each.start, each.end), each.name, each.by) for each in named if each.name)


@dataclass(frozen=True, eq=False)
class Filled:
    """A clause matched to a taught frame; `objects` maps each object of the frame to the one of the clause."""

    frame: Frame
    objects: Mapping[str, str]
    clause: ParsedClause


def _meanings(taught: Taught, phrases: NounPhrases) -> list[Order]:
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
    return max((MEANS.index(each.by) for each in order.phrases), default=0), -len(order.phrases)


def _plans(taught: Taught, reading: Sequence[ParsedClause]) -> Iterator[tuple[Filled, ...]]:
    """Yield the reading's clauses matched to frames that were taught in this sequence, or that may each stand alone."""
    per_clause = [_choices(taught, clause) for clause in reading]
    for choice in islice(product(*per_clause), MAX_READINGS):
        plan = tuple(filled for part in choice for filled in part)
        signatures = tuple(filled.frame.clause.signature for filled in plan)
        alone = all(filled.frame.may_stand_alone for filled in plan)
        if any(signatures == frame.plan for frame in taught.frames) or (
            alone and not _wants_moved(plan) and not picks_with_full_hand([filled.clause for filled in plan])
        ):
            yield plan


def _choices(taught: Taught, clause: ParsedClause) -> list[tuple[Filled, ...]]:
    """Return the alternatives that a clause may ask for, each as matched frames: "red and blue" is two in sequence."""
    if whole := _best(taught, clause):
        return [(filled,) for filled in whole]
    objects = clause.objects_in(DIRECT)
    if len(objects) < 2 or len(clause.roles) > 1:
        return []
    parts = [_best(taught, replace(clause, roles=((DIRECT, (phrase,)),))) for phrase in objects]
    return list(product(*parts)) if all(parts) else []


def _best(taught: Taught, clause: ParsedClause) -> list[Filled]:
    """Return the closest matching frame of each signature, preferring frames taught with the clause's own objects."""
    every = [
        Filled(frame, objects, clause)
        for frame in taught.frames
        if (objects := frame.filled(clause, taught.names)) is not None
    ]
    by_signature: dict[object, Filled] = {}
    said = {phrase.name for phrase in clause.phrases}
    for filled in sorted(closest(every), key=lambda filled: any(a != b for a, b in filled.objects.items())):
        added = frozenset(filled.objects.values()) - said  # instruments and sources that the clause leaves out
        by_signature.setdefault((filled.frame.clause.signature, added), filled)
    return list(by_signature.values())


def closest(every: list[Filled]) -> list[Filled]:
    """Keep the matches with the clause's instrument, then verb, then fixed words, each as far as there are any."""
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
    """Return whether a clause uses an object that an earlier one moved, or moves one that it put something on.

    An object's pose is known only before the first action, and a covered one cannot be grasped as it was taught.
    Picking the same object up twice in a row is allowed.
    """
    moved: set[str] = set()
    covered: set[str | None] = set()
    for k, filled in enumerate(plan):
        picks = filled.clause.verb in verbs.PICKING and len(filled.clause.roles) <= 1
        again = picks and k > 0 and filled.objects == plan[k - 1].objects and filled.frame is plan[k - 1].frame
        if not again and not moved.isdisjoint(phrase.name for phrase in filled.clause.phrases if phrase.name):
            return True
        if picks or filled.clause.takes_somewhere:
            direct = {phrase.name for phrase in filled.clause.objects_in(DIRECT) if phrase.name}
            if not covered.isdisjoint(direct):
                return True
            moved |= direct
            covered |= {phrase.name for phrase in filled.clause.objects_in("on")}
    return False


def refusal(taught: Taught, phrases: NounPhrases, meanings: Sequence[str]) -> InstructionError:
    """Return the error for an instruction with no reading, or with several.

    Args:
        meanings: the canonical instructions that it may mean.
    """
    valid, instruction, words = _valid(taught), phrases.instruction, phrases.words
    if meanings:
        listed = " or ".join(repr(text) for text in meanings[:3])
        return UngroundedInstructionError(FIELD, f"{instruction!r} may mean {listed}", valid)
    if not _asks_for_taught(taught, words):
        return UnfamiliarInstructionError(FIELD, f"{instruction!r} is unlike what the task was taught", valid)
    if (missed := _missed(phrases)) is not None:
        return _ungrounded(phrases, missed, valid)
    if unknown := [repr(word.token.text) for word in words if not word.known and word.text[0].isalnum()]:
        message = f"the words {', '.join(unknown)} of {instruction!r} are not understood"
        return UnfamiliarInstructionError(FIELD, message, valid)
    what = "says what not to do in a way that is not understood"
    if not forbids(words):
        what = "is no order in a form that was taught: another place, direction, number, role or sequence, or a report"
    return UnfamiliarInstructionError(FIELD, f"{instruction!r} {what}", valid)


def _passed_on(taught: Taught, phrases: NounPhrases) -> tuple[str, Sequence[NounPhrase]]:
    """Return the unfamiliar instruction with objects by their names, and the phrases that name them.

    Raises:
        UngroundedInstructionError: if it names an unknown thing, names no object though taught instructions do, or
            forbids something: the object acted on would be arbitrary.
    """
    valid, instruction, words = _valid(taught), phrases.instruction, phrases.words
    if forbids(words):
        raise UngroundedInstructionError(FIELD, f"{instruction!r} says what not to do", valid)
    if (missed := _missed(phrases)) is not None:
        raise _ungrounded(phrases, missed, valid)
    found = _longest(phrases)
    if not found and any(clause_of(text, taught.names).objects for text in taught.instructions):
        raise UngroundedInstructionError(FIELD, f"{instruction!r} names no object of the task", valid)
    text = phrases.with_names(phrase for phrase in found if phrase.by != "name")
    if clause_of(text, taught.names).objects != tuple(dict.fromkeys(phrase.name for phrase in found)):
        raise UngroundedInstructionError(FIELD, f"{instruction!r} names its objects in an unclear way", valid)
    return text, found


def forbids(words: Sequence[Word]) -> bool:
    """Return whether some words forbid an action ("not", "skip", "instead of")."""
    texts = [word.text for word in words]
    tables = (vocabulary.NOT, vocabulary.SKIP, vocabulary.RATHER)
    return any(table.end_at(texts, k) is not None for table in tables for k in range(len(texts)))


def _longest(phrases: NounPhrases) -> list[NounPhrase]:
    """Return the phrases that name objects, from left to right, each as long as possible, without overlap."""
    found: list[NounPhrase] = []
    for k in range(len(phrases.words)):
        if (not found or k >= found[-1].end) and (here := phrases.at(k)) and here[0].name:
            found.append(here[0])
    return found


def _missed(phrases: NounPhrases) -> Unmatched | None:
    """Return the longest noun phrase that matches no single object (nor is part of one that does), or unknown noun."""
    found = _longest(phrases)

    def is_part(missed: Unmatched) -> bool:
        return any(each.start < missed.end and missed.start < each.end and not _holds(missed, each) for each in found)

    missed = [each for each in phrases.unmatched if not is_part(each)]
    longest = max(missed, key=lambda each: (each.end - each.start, -each.start, each.candidates), default=None)
    return longest or _unknown_thing(phrases.words)


def _holds(missed: Unmatched, phrase: NounPhrase) -> bool:
    """Return whether an unmatched phrase contains a matched one and more: "the bottom drawer" contains "drawer"."""
    return missed.start <= phrase.start and phrase.end <= missed.end and missed[:2] != phrase[:2]


def _unknown_thing(words: Sequence[Word]) -> Unmatched | None:
    """Return the first unknown word in the position of a noun: after an article, a preposition or a verb."""
    before = vocabulary.DETERMINERS | verbs.FIRST_WORDS | {phrase[-1] for phrase in vocabulary.PREPOSITIONS}
    for k, word in enumerate(words[1:], start=1):
        if not word.known and words[k - 1].text in before:
            return Unmatched(k - 1 if words[k - 1].text in vocabulary.DETERMINERS else k, k + 1, ())
    return None


def _asks_for_taught(taught: Taught, words: Sequence[Word]) -> bool:
    """Return whether a verb of the instruction equals or resembles a taught one; True for a clause without a verb."""
    clauses = [frame.clause for frame in taught.frames]
    said = [word.text for word in words if word.text in verbs.FIRST_WORDS or any(c.verb == word.text for c in clauses)]
    if not said:
        return bool(words) and (words[0].known or words[0].text in vocabulary.DETERMINERS)
    return any(
        verb == clause.verb or (clause.verb or "").split()[:1] == [verb] or clause.families_with(verb)
        for verb in said
        for clause in clauses
    )


def _ungrounded(phrases: NounPhrases, missed: Unmatched, valid: str) -> UngroundedInstructionError:
    text = phrases.text_of(missed.start, missed.end)
    if missed.candidates:
        return UngroundedInstructionError(FIELD, f"{text!r} may be {', '.join(missed.candidates)}", valid)
    return UngroundedInstructionError(FIELD, f"{text!r} is none of the task's objects", valid)


def _valid(taught: Taught) -> str:
    objects = [
        f"{name} (or {', '.join(taught.aliases[name])})" if taught.aliases.get(name) else name for name in taught.names
    ]
    listed = [repr(text) for text in taught.instructions[:MAX_LISTED]]
    more = len(taught.instructions) - len(listed)
    known = f"; taught {', '.join(listed)}" + (f" and {more} more" if more > 0 else "") if listed else ""
    return f"objects {', '.join(objects)}{known}"
