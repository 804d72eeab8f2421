"""Why an instruction is not understood, and what the task knows instead."""

from collections.abc import Mapping, Sequence
from typing import Protocol

from app.pipeline.errors import InstructionError, UnfamiliarInstructionError, UngroundedInstructionError
from app.pipeline.language import grammar, verbs
from app.pipeline.language.clause_parser import DIRECT
from app.pipeline.language.frames import Frame
from app.pipeline.language.mentions import mention_order
from app.pipeline.language.phrases import Miss, NounPhrase, NounPhrases
from app.pipeline.language.words import Word

FIELD = "instruction"
MAX_LISTED = 12  # instructions that a refusal repeats
_THINGS = grammar.GENERIC_NOUNS.union(*grammar.NOUN_KINDS)  # nouns that are known though no object has them


class Known(Protocol):
    """What a task was taught, as far as a refusal tells it."""

    @property
    def frames(self) -> Sequence[Frame]: ...

    @property
    def names_objects(self) -> bool: ...

    @property
    def names(self) -> Sequence[str]: ...

    @property
    def aliases(self) -> Mapping[str, Sequence[str]]: ...

    @property
    def instructions(self) -> Sequence[str]: ...


def refusal(
    known: Known, instruction: str, words: Sequence[Word], phrases: NounPhrases, meanings: Sequence[str]
) -> InstructionError:
    """The error for an instruction without a meaning, or with several.

    Args:
        meanings: the canonical instructions that it may stand for.
    """
    valid = _valid(known)
    if meanings:
        listed = " or ".join(repr(text) for text in meanings[:3])
        return UngroundedInstructionError(FIELD, f"{instruction!r} may mean {listed}", valid)
    missed = _missed(words, phrases)
    if not _asks_for_taught(known, words):
        return UnfamiliarInstructionError(FIELD, f"{instruction!r} is unlike what the task was taught", valid)
    if (missed := missed or _unknown_thing(words)) is not None:
        return _ungrounded(instruction, words, missed, valid)
    if unknown := [repr(word.token.text) for word in words if not word.known and word.text[0].isalnum()]:
        message = f"the words {', '.join(unknown)} of {instruction!r} are not understood"
        return UnfamiliarInstructionError(FIELD, message, valid)
    what = "says what not to do in a way that is not understood"
    if not _forbids(words):
        what = "is no order in a form that was taught: another place, direction, number, role or sequence, or a report"
    return UnfamiliarInstructionError(FIELD, f"{instruction!r} {what}", valid)


def passed_on(
    known: Known, instruction: str, words: Sequence[Word], phrases: NounPhrases
) -> tuple[str, Sequence[NounPhrase]]:
    """The unfamiliar instruction with its objects by their names, and where it names them.

    Raises:
        UngroundedInstructionError: if it names something else, names nothing though taught instructions do, or forbids
            something: which object is acted on would be chance.
    """
    valid = _valid(known)
    if _forbids(words):
        raise UngroundedInstructionError(FIELD, f"{instruction!r} says what not to do", valid)
    if (missed := _missed(words, phrases) or _unknown_thing(words)) is not None:
        raise _ungrounded(instruction, words, missed, valid)
    found = _found(words, phrases)
    if known.names_objects and not found:
        raise UngroundedInstructionError(FIELD, f"{instruction!r} names no object of the task", valid)
    text = _with_names(instruction, words, found)
    if mention_order(known.names, text) != tuple(dict.fromkeys(phrase.name for phrase in found)):
        raise UngroundedInstructionError(FIELD, f"{instruction!r} names its objects in an unclear way", valid)
    return text, found


def _forbids(words: Sequence[Word]) -> bool:
    """Whether it says what not to do."""
    texts = [word.text for word in words]
    tables = (grammar.NOT, grammar.SKIP, grammar.RATHER)
    return any(table.end_at(texts, k) is not None for table in tables for k in range(len(texts)))


def check_named(known: Known, instruction: str, words: Sequence[Word], found: Sequence[NounPhrase]) -> None:
    """Refuse an untaught instruction that names a thing which no object is, or none of several objects.

    Args:
        found: where it names objects.

    Raises:
        UngroundedInstructionError.
    """
    valid = _valid(known)
    inside = {place for phrase in found for place in range(phrase.start, phrase.end)}
    for place, word in enumerate(words):
        is_verb = word.text in verbs.FIRST_WORDS and (place == 0 or words[place - 1].text not in grammar.DETERMINERS)
        if word.text in _THINGS and place not in inside and not is_verb:
            raise _ungrounded(instruction, words, Miss(place, place + 1, ()), valid)
    if not found and len(known.names) > 1:
        raise UngroundedInstructionError(FIELD, f"{instruction!r} names no object of the scene", valid)


def _with_names(instruction: str, words: Sequence[Word], found: Sequence[NounPhrase]) -> str:
    for phrase in reversed(found):
        start, end = words[phrase.start].token.start, words[phrase.end - 1].token.end
        if phrase.by != "name" and phrase.name:
            instruction = f"{instruction[:start]}the {phrase.name.replace('_', ' ')}{instruction[end:]}"
    return instruction


def _found(words: Sequence[Word], phrases: NounPhrases) -> list[NounPhrase]:
    """The objects from left to right, each phrase as long as possible."""
    found: list[NounPhrase] = []
    for k in range(len(words)):
        if (not found or k >= found[-1].end) and (here := phrases.at(k)) and here[0].name:
            found.append(here[0])
    return found


def _missed(words: Sequence[Word], phrases: NounPhrases) -> Miss | None:
    """The longest phrase that reads like an object and is none, unless it is a part of one that is."""
    found = _found(words, phrases)

    def is_part(miss: Miss) -> bool:
        return any(each.start < miss.end and miss.start < each.end and not _holds(miss, each) for each in found)

    return max(
        (miss for miss in phrases.misses if not is_part(miss)),
        key=lambda miss: (miss.end - miss.start, -miss.start),
        default=None,
    )


def _holds(miss: Miss, phrase: NounPhrase) -> bool:
    """Whether a phrase without an object goes beyond one with an object: "the bottom drawer" beyond "drawer"."""
    return miss.start <= phrase.start and phrase.end <= miss.end and miss[:2] != phrase[:2]


def _unknown_thing(words: Sequence[Word]) -> Miss | None:
    """The first unknown word where an object belongs: after an article, a preposition or a verb."""
    before = grammar.DETERMINERS | verbs.FIRST_WORDS | {phrase[-1] for phrase in grammar.PREPOSITIONS}
    for k, word in enumerate(words[1:], start=1):
        if not word.known and words[k - 1].text in before:
            return Miss(k - 1 if words[k - 1].text in grammar.DETERMINERS else k, k + 1, ())
    return None


def _asks_for_taught(known: Known, words: Sequence[Word]) -> bool:
    """Whether some verb of the instruction is like a taught one; a clause without a verb leaves that open."""
    taught = [frame.clause for frame in known.frames]
    said = [word.text for word in words if word.text in verbs.FIRST_WORDS or any(c.verb == word.text for c in taught)]
    if not said:
        return bool(words) and (words[0].known or words[0].text in grammar.DETERMINERS)
    return any(
        verb == clause.verb
        or (clause.verb or "").split()[:1] == [verb]
        or verbs.common_families(verb, clause.verb or "", {role for role, _ in clause.roles if role != DIRECT})
        for verb in said
        for clause in taught
    )


def _ungrounded(instruction: str, words: Sequence[Word], missed: Miss, valid: str) -> UngroundedInstructionError:
    text = instruction[words[missed.start].token.start : words[missed.end - 1].token.end]
    if missed.candidates:
        return UngroundedInstructionError(FIELD, f"{text!r} may be {', '.join(missed.candidates)}", valid)
    return UngroundedInstructionError(FIELD, f"{text!r} is none of the task's objects", valid)


def _valid(known: Known) -> str:
    """What the task knows."""
    objects = [
        f"{name} (or {', '.join(known.aliases[name])})" if known.aliases.get(name) else name for name in known.names
    ]
    listed = [repr(text) for text in known.instructions[:MAX_LISTED]]
    more = len(known.instructions) - len(listed)
    taught = f"; taught {', '.join(listed)}" + (f" and {more} more" if more > 0 else "") if listed else ""
    return f"objects {', '.join(objects)}{taught}"
