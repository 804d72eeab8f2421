"""Why an instruction is refused: which phrase, and what is wrong with it.

In this order: it has several meanings; its verb was not taught; a noun phrase stands for no object or for several; a
word is unknown; no taught instruction has its form.
"""

from collections.abc import Sequence
from difflib import get_close_matches
from typing import NamedTuple

from app.pipeline.errors import InstructionError, UnfamiliarInstructionError, UngroundedInstructionError
from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.clause_parser import Accepted
from app.pipeline.order.descriptions import NounPhrase, Unmatched
from app.pipeline.order.lexicon import Text
from app.pipeline.order.noun_phrases import NounPhrases
from app.pipeline.order.order import FIELD, Order
from app.pipeline.order.sentences import Sentences
from app.pipeline.order.taught import TaughtWords

MAX_LISTED = 12  # instructions that a refusal repeats


class Refusal(NamedTuple):
    """Why an instruction is refused."""

    message: str
    kind: type[InstructionError] = UngroundedInstructionError

    @property
    def is_unfamiliar(self) -> bool:
        """Whether the instruction is unlike every taught one, though it may be clear which objects it names."""
        return issubclass(self.kind, UnfamiliarInstructionError)

    def error(self, valid: str) -> InstructionError:
        """Return it as an exception that says what would be valid."""
        return self.kind(FIELD, self.message, valid)


def question(said: str) -> Refusal:
    """Return the refusal of a question."""
    return Refusal(f"{said!r} is a question: say what to do, without a question mark", UnfamiliarInstructionError)


def refusal(taught: TaughtWords, phrases: NounPhrases, meanings: Sequence[str], part_of: str = "") -> Refusal:
    """Return why an instruction with no reading, or with several, is refused.

    Args:
        meanings: the canonical instructions that it may mean.
        part_of: the taught instruction of which it asks for a part only.
    """
    said = repr(phrases.text.instruction)
    if meanings:
        return Refusal(f"{said} may mean {' or '.join(map(repr, meanings[:3]))}: say which")
    if part_of:
        message = f"{said} was taught as a part of {part_of!r} only: ask for all of it"
        return Refusal(message, UnfamiliarInstructionError)
    why = _not_understood(taught, phrases)
    meant = None if phrases.text.forbids else _suggestion(taught, phrases.text)
    return why._replace(message=f"{why.message}: did you mean {meant!r}?") if meant else why


def _not_understood(taught: TaughtWords, phrases: NounPhrases) -> Refusal:
    said = repr(phrases.text.instruction)
    if (verb := _untaught_verb(taught, phrases)) is not None:
        return Refusal(f"{verb!r} in {said} is no action that was taught", UnfamiliarInstructionError)
    if (missed := _missed(phrases)) is not None:
        return missed
    if unknown := _unknown(phrases.text):
        return unknown
    if phrases.text.forbids:
        what = "says what not to do in a way that is not understood: say only what to do"
    else:
        what = "has the form of no taught instruction: it says another place, direction, number, role or sequence"
    return Refusal(f"{said} {what}", UnfamiliarInstructionError)


def _unknown(text: Text) -> Refusal | None:
    if not text.unknown:
        return None
    listed = ", ".join(map(repr, text.unknown))
    message = f"{listed} in {text.instruction!r} {'is' if len(text.unknown) == 1 else 'are'} not understood"
    return Refusal(message, UnfamiliarInstructionError)


def _suggestion(taught: TaughtWords, text: Text) -> str | None:
    """Return the known word, or else the taught instruction, that may have been meant; None if none is similar."""
    words = (taught.lexicon.nearest(word) for word in text.unknown)
    return next(filter(None, words), None) or next(
        iter(get_close_matches(text.instruction, taught.instructions, 1)), None
    )


def unfamiliar_text(taught: TaughtWords, phrases: NounPhrases) -> tuple[str, Sequence[NounPhrase]] | Refusal:
    """Return an unfamiliar instruction with objects by their names, and the phrases that name them.

    It must be an English imperative of which every word has a role, and name known objects alone. If it forbids
    something, the object acted on would be arbitrary, or the one that is to be left alone.
    """
    said = repr(phrases.text.instruction)
    if phrases.text.forbids:
        return Refusal(f"{said} says what not to do: an instruction that was not taught may only say what to do")
    if (missed := _missed(phrases) or _unknown(phrases.text)) is not None:
        return missed
    verbs_, fixed, _ = taught.accepted
    times = frozenset(word for words in vocabulary.TIMES for word in words)
    parses = Sentences(phrases, Accepted(verbs_, (fixed or frozenset()) | times, of_steps=True)).units()
    if not any(units[0].own_verb and all(unit.mood == "do" for unit in units) for units in parses):
        return Refusal(f"{said} has words without a role in an order")
    found = _longest(phrases)
    if not found:
        return Refusal(f"{said} names none of the known objects")
    text = phrases.with_names(phrase for phrase in found if phrase.by != "name")
    if Order(text, taught.names).objects != tuple(dict.fromkeys(phrase.name for phrase in found)):
        return Refusal(f"{said} does not name its objects clearly: call each by its name")
    return text, found


def valid_instructions(taught: TaughtWords) -> str:
    """Return the objects and taught instructions of a task, as a refusal lists them."""
    aliases = {name: f" (or {', '.join(words)})" for name, words in taught.aliases.items() if words}
    objects = ", ".join(f"{name}{aliases.get(name, '')}" for name in taught.names)
    listed = ", ".join(map(repr, taught.instructions[:MAX_LISTED]))
    more = len(taught.instructions) - MAX_LISTED
    return f"objects {objects}" + (f"; taught {listed}" if listed else "") + (f" and {more} more" if more > 0 else "")


def _longest(phrases: NounPhrases) -> list[NounPhrase]:
    """Return the phrases that name objects, from left to right, each as long as possible, without overlap."""
    found: list[NounPhrase] = []
    for k in range(len(phrases.text.words)):
        if (not found or k >= found[-1].end) and (here := phrases.at(k)) and here[0].name:
            found.append(here[0])
    return found


def _missed(phrases: NounPhrases) -> Refusal | None:
    """Return why the longest noun phrase without an object of its own, or else an unknown noun, is refused."""
    found = _longest(phrases)

    def is_part(missed: Unmatched) -> bool:
        return any(each.start < missed.end and missed.start < each.end and not _holds(missed, each) for each in found)

    missed = [each for each in phrases.unmatched if not is_part(each)]
    longest = max(missed, key=lambda each: (each.end - each.start, -each.start, each.candidates), default=None)
    if (longest := longest or _unknown_thing(phrases)) is None:
        return None
    # "The left bowl on the tray" may say where to put the left bowl.
    within = [each for each in missed if each.start == longest.start and each.candidates]
    if not longest.candidates and within:
        longest = max(within, key=lambda each: (each.end, each.candidates))
    said = repr(phrases.text.written(longest.start, longest.end))
    if longest.candidates:
        return Refusal(f"{said} may be {', '.join(longest.candidates)}: say which")
    return Refusal(f"{said} is none of the known objects")


def _holds(missed: Unmatched, phrase: NounPhrase) -> bool:
    return missed.start <= phrase.start and phrase.end <= missed.end and missed[:2] != phrase[:2]


def _unknown_thing(phrases: NounPhrases) -> Unmatched | None:
    """Return the first unknown word in the position of a noun: after an article, a preposition or a verb."""
    before = vocabulary.DETERMINERS | verbs.FIRST_WORDS | {phrase[-1] for phrase in vocabulary.PREPOSITIONS}
    texts = phrases.text.texts
    for k, word in enumerate(phrases.text.words[1:], start=1):
        if not word.known and texts[k - 1] in before:
            return Unmatched(k - 1 if texts[k - 1] in vocabulary.DETERMINERS else k, k + 1, ())
    return None


def _untaught_verb(taught: TaughtWords, phrases: NounPhrases) -> str | None:
    """Return the verb, or the unknown first word, of an instruction of which no verb equals or resembles a taught one.

    None for a clause without a verb.
    """
    words, clauses = phrases.text.words, [frame.clause for frame in taught.frames]
    said = [word for word in words if word.text in verbs.FIRST_WORDS or any(c.verb == word.text for c in clauses)]
    if not said:
        known = bool(words) and (words[0].known or words[0].text in vocabulary.DETERMINERS)
        return None if known else words[0].token.text if words else ""
    resembles = any(
        word.text == clause.verb or (clause.verb or "").split()[:1] == [word.text] or clause.families_with(word.text)
        for word in said
        for clause in clauses
    )
    return None if resembles else said[0].token.text
