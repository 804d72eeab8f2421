"""Why an instruction has no meaning that was taught: the error that names the words and lists what the task knows."""

from collections.abc import Sequence

from app.pipeline.errors import InstructionError, UnfamiliarInstructionError, UngroundedInstructionError
from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.descriptions import NounPhrase, Unmatched
from app.pipeline.order.lexicon import Word
from app.pipeline.order.noun_phrases import NounPhrases
from app.pipeline.order.order import FIELD, clause_of
from app.pipeline.order.taught import TaughtWords

MAX_LISTED = 12  # instructions that a refusal repeats


def refusal(taught: TaughtWords, phrases: NounPhrases, meanings: Sequence[str]) -> InstructionError:
    """Return the error for an instruction with no reading, or with several.

    Args:
        meanings: the canonical instructions that it may mean.
    """
    valid, instruction, words = _valid(taught), phrases.text.instruction, phrases.text.words
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
    if not phrases.text.forbids:
        what = "is no order in a form that was taught: another place, direction, number, role or sequence, or a report"
    return UnfamiliarInstructionError(FIELD, f"{instruction!r} {what}", valid)


def unfamiliar_text(taught: TaughtWords, phrases: NounPhrases) -> tuple[str, Sequence[NounPhrase]]:
    """Return the unfamiliar instruction with objects by their names, and the phrases that name them.

    Raises:
        UngroundedInstructionError: if it names an unknown thing, names no object though taught instructions do, or
            forbids something: the object acted on would be arbitrary.
    """
    valid, instruction = _valid(taught), phrases.text.instruction
    if phrases.text.forbids:
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


def _longest(phrases: NounPhrases) -> list[NounPhrase]:
    """Return the phrases that name objects, from left to right, each as long as possible, without overlap."""
    found: list[NounPhrase] = []
    for k in range(len(phrases.text.words)):
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
    return longest or _unknown_thing(phrases.text.words)


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


def _asks_for_taught(taught: TaughtWords, words: Sequence[Word]) -> bool:
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
    text = phrases.text.written(missed.start, missed.end)
    if missed.candidates:
        return UngroundedInstructionError(FIELD, f"{text!r} may be {', '.join(missed.candidates)}", valid)
    return UngroundedInstructionError(FIELD, f"{text!r} is none of the task's objects", valid)


def _valid(taught: TaughtWords) -> str:
    objects = [
        f"{name} (or {', '.join(taught.aliases[name])})" if taught.aliases.get(name) else name for name in taught.names
    ]
    listed = [repr(text) for text in taught.instructions[:MAX_LISTED]]
    more = len(taught.instructions) - len(listed)
    known = f"; taught {', '.join(listed)}" + (f" and {more} more" if more > 0 else "") if listed else ""
    return f"objects {', '.join(objects)}{known}"
