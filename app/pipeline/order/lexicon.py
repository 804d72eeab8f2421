"""The words of one task, and the words of an instruction looked up among them."""

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

from app.pipeline.errors import UngroundedInstructionError
from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.forms import VERB_FORMS, plurals_of, singulars_of
from app.pipeline.order.vocabulary import FUNCTION_WORDS, NUMBERS, Phrase, PhraseTable
from app.pipeline.order.words import Token, noun_of, phrase_of, tokens_of

MAX_STEPS = 4000  # of one parse; an instruction that needs more is refused as too involved
_NOUNS = vocabulary.GENERIC_NOUNS.union(*vocabulary.NOUN_KINDS)


class TooInvolvedError(UngroundedInstructionError):
    """The parse takes more than `MAX_STEPS` steps."""


class Word(NamedTuple):
    """A token looked up in the lexicon.

    Attributes:
        text: its base form; the token's own text if it is unknown.
        known: whether the lexicon has it.
        plural: whether the token is the plural of `text`.
    """

    token: Token
    text: str
    known: bool = True
    plural: bool = False


class Lexicon:
    """Every word that can be understood in one task.

    Args:
        names: the task's objects.
        aliases: by object what else it is called.
        taught: the instructions that demonstrations carry out.

    Attributes:
        phrases: what may stand for an object, by object: its name, then its aliases.
        called: by whole name or alias its objects, each with "name" or "alias".
        name_words: the words of names.
        objects_of: by word the objects that have it in their name or in an alias.
        loose: those of the words that may tell an object apart by themselves.
    """

    def __init__(self, names: Sequence[str], aliases: Mapping[str, Sequence[str]], taught: Sequence[str]) -> None:
        self.names = tuple(names)
        self.phrases = {name: tuple(map(phrase_of, (name, *aliases.get(name, ())))) for name in names}
        self.name_words = {word for phrases in self.phrases.values() for word in phrases[0]}
        self.objects_of: dict[str, frozenset[str]] = {}
        called: dict[Phrase, list[tuple[str, str]]] = {}
        for name, phrases in self.phrases.items():
            for number, phrase in enumerate(phrases):
                called.setdefault(phrase, []).append((name, "alias" if number else "name"))
                for word in phrase:
                    self.objects_of[word] = self.objects_of.get(word, frozenset()) | {name}
        self.called = PhraseTable(called)
        self.loose = self.objects_of.keys() - vocabulary.NEVER_LOOSE
        self._taught = {token.text for text in taught for token in tokens_of(text)}

    def read(self, text: str) -> list[Word]:
        """Return the text's words in base form."""
        return [self._word(token) for token in self._compounds(tokens_of(text))]

    def is_english(self, text: str) -> bool:
        """Return whether a text has the word "the", or no word beyond names and the vocabulary of all tasks."""
        texts = [token.text for token in self._compounds(tokens_of(text))]
        return "the" in texts or all(self._listed(text) or text in VERB_FORMS for text in texts)

    def nearest(self, unknown: str) -> str | None:
        """Return the word of names, aliases and taught instructions that is spelled most like it; None without one."""
        return next(iter(get_close_matches(unknown, sorted({*self.objects_of, *self._taught}), 1)), None)

    def kind_of(self, noun: str) -> frozenset[str]:
        """Return the objects that a synonym of their noun may name: "block" for `red cube`."""
        kinds = [kind for kind in vocabulary.NOUN_KINDS if noun in kind]
        return frozenset(name for kind in kinds for other in kind for name in self.objects_of.get(other, ()))

    def is_meant(self, name: str, words: Iterable[str]) -> bool:
        """Return whether these words of an object's name or alias suffice: noun, distinctive words, or adjectives.

        "The cup" does not name a cup holder, nor "the wine" a wine bottle.
        """
        said = frozenset(words)
        nouns = {noun_of(phrase) for phrase in self.phrases[name]}
        own = {word for word in self.phrases[name][0] if self.objects_of[word] == {name}}
        return bool(said & nouns) or said <= vocabulary.ADJECTIVES or (bool(own) and own <= said)

    def with_noun(self, noun: str) -> frozenset[str]:
        """Return the objects with a name or alias that ends in this noun."""
        return frozenset(name for name, phrases in self.phrases.items() if any(noun_of(p) == noun for p in phrases))

    def of_color(self, color: str) -> frozenset[str]:
        """Return the objects whose name or alias has a word for a similar color."""
        own = [word for word in self.objects_of if word in vocabulary.COLORS and vocabulary.look_alike(color, word)]
        return frozenset(name for word in own for name in self.objects_of[word])

    def _compounds(self, tokens: Sequence[Token]) -> list[Token]:
        """Return the tokens with compounds written as the task has them: "hotplate" and "peg board" among its words."""
        found: list[Token] = []
        for token in tokens:
            before = found[-1] if found else token
            if token.text in self._open_compounds and self._known(token.text) is None:
                found += [token._replace(text=part) for part in self._open_compounds[token.text]]
            elif found and self._is_compound(before.text, token.text):
                found[-1] = Token(before.text + token.text, before.start, token.end)
            else:
                found.append(token)
        return found

    def _is_compound(self, one: str, other: str) -> bool:
        joined, parts = one + other, {self._known(one), self._known(other)}
        known = joined in self.objects_of or joined in self._taught
        return known and None in parts and FUNCTION_WORDS.isdisjoint(parts)  # "not able" is not "notable"

    def _word(self, token: Token) -> Word:
        if (known := self._known(token.text)) is not None:
            return Word(token, known, plural=known in self._nouns and token.text in plurals_of(known))
        return Word(token, token.text, known=False)

    def _known(self, text: str) -> str | None:
        """Return the base form of a known word; None for an unknown one."""
        return self._listed(text) or (text if text in self._taught else VERB_FORMS.get(text))

    def _listed(self, text: str) -> str | None:
        """Return the base form of a word of names, aliases and tables."""
        if text in self.objects_of:
            return text
        if text in NUMBERS:
            return NUMBERS[text]
        if nouns := singulars_of(text) & self._nouns:
            return min(nouns)
        return text if text in self._exact else None

    @cached_property
    def _nouns(self) -> frozenset[str]:
        return frozenset({*self.objects_of, *_NOUNS} - FUNCTION_WORDS)

    @cached_property
    def _exact(self) -> frozenset[str]:
        described = {*vocabulary.COLORS, *vocabulary.SHADES_OF, *vocabulary.IN_NAMES, *NUMBERS.values()}
        return FUNCTION_WORDS.union(described, _NOUNS, verbs.PARTICLES, verbs.FIRST_WORDS, *vocabulary.TIMES)

    @cached_property
    def _open_compounds(self) -> dict[str, Phrase]:
        pairs = [pair for phrases in self.phrases.values() for phrase in phrases for pair in pairwise(phrase)]
        return {"".join(pair): pair for pair in pairs}


class Text:
    """The words of one instruction.

    Attributes:
        words: in base form where the lexicon has them; `texts`: the same as strings.
        steps: of its parse so far.
    """

    def __init__(self, instruction: str, lexicon: Lexicon) -> None:
        self.instruction = instruction
        self.words = lexicon.read(instruction)
        self.texts = [word.text for word in self.words]
        self.steps = 0

    def at(self, place: int) -> str:
        """Return the word there; empty at the end."""
        return self.texts[place] if place < len(self.texts) else ""

    def end(self, place: int, table: PhraseTable[Any]) -> int | None:
        """Return the end of the longest phrase of the table that begins there; None without one."""
        return table.end_at(self.texts, place)

    def written(self, start: int, end: int) -> str:
        """Return the characters of the words from `start` to `end`, as they were written."""
        return self.instruction[self.words[start].token.start : self.words[end - 1].token.end]

    @property
    def unknown(self) -> list[str]:
        """The words that are not known, as they were written but in lower case."""
        return [word.text for word in self.words if not word.known and word.text[0].isalnum()]

    @property
    def forbids(self) -> bool:
        """Whether some words forbid something: "not", "skip", "instead of"."""
        tables = (vocabulary.NOT, vocabulary.SKIP, vocabulary.RATHER)
        return any(self.end(place, table) is not None for table in tables for place in range(len(self.texts)))

    def count_step(self) -> None:
        """Count one step of the parse.

        Raises:
            TooInvolvedError: after too many.
        """
        self.steps += 1
        if self.steps > MAX_STEPS:
            message = f"{self.instruction!r} is too involved: it can be read in too many ways"
            raise TooInvolvedError("instruction", message, "fewer things at once")
