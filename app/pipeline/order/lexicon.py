"""Every word that can be understood in one task: its objects' names and aliases, and what is the same for all tasks."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import pairwise

from app.pipeline.names import folded_name
from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.vocabulary import ADJECTIVES, FUNCTION_WORDS, GENERIC_NOUNS, NEVER_LOOSE, NOUN_KINDS
from app.pipeline.order.words import (
    NUMBERS,
    IsWord,
    Phrase,
    PhraseTable,
    Speller,
    Token,
    Word,
    plurals_of,
    singulars_of,
    tokens_of,
)
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.names import checked_name

_NOUNS = GENERIC_NOUNS.union(*NOUN_KINDS)


class Lexicon:
    """The words of a task.

    Args:
        names: the task's objects.
        aliases: by object what else it is called.
        taught: the instructions that demonstrations carry out.
        is_word: whether a word is English: such a word is taken at its own meaning, never for a misspelled other.

    Attributes:
        phrases: what may stand for an object, by object: its name, then its aliases.
        objects_of: by word the objects that have it in their name or in an alias.
        loose: those of the words that may tell an object apart by themselves.
        table, called: the whole names and aliases, and for each its objects and "name" or "alias".
    """

    def __init__(
        self, names: Sequence[str], aliases: Mapping[str, Sequence[str]], taught: Sequence[str], is_word: IsWord
    ) -> None:
        self.names = tuple(names)
        self.phrases: dict[str, tuple[Phrase, ...]] = {
            name: tuple(phrase_of(text) for text in (name, *aliases.get(name, ()))) for name in names
        }
        self.name_words = {word for phrases in self.phrases.values() for word in phrases[0]}
        self.objects_of: dict[str, frozenset[str]] = {}
        for name, phrases in self.phrases.items():
            for word in {word for phrase in phrases for word in phrase}:
                self.objects_of[word] = self.objects_of.get(word, frozenset()) | {name}
        self.loose = self.objects_of.keys() - NEVER_LOOSE
        self.called: dict[Phrase, list[tuple[str, str]]] = {}
        for name, phrases in self.phrases.items():
            for number, phrase in enumerate(phrases):
                self.called.setdefault(phrase, []).append((name, "alias" if number else "name"))
        self.table = PhraseTable(self.called)
        self._taught = {token.text for text in taught for token in tokens_of(text)}
        self._is_word = is_word

    def read(self, text: str) -> list[Word]:
        """Return the text's words in base form, corrected where they are misspelled."""
        return [self._word(token) for token in self._compounds(tokens_of(text))]

    def _compounds(self, tokens: Sequence[Token]) -> list[Token]:
        """Return the tokens with compounds written as the task has them: "hotplate" and "peg board" among its words."""
        found: list[Token] = []
        for token in tokens:
            before = found[-1] if found else token
            joined = before.text + token.text
            if token.text in self._open_compounds and self._known(token.text) is None:
                found += [token._replace(text=part) for part in self._open_compounds[token.text]]
            elif (joined in self.objects_of or joined in self._taught) and None in (
                self._known(before.text),
                self._known(token.text),
            ):
                found[-1] = Token(joined, before.start, token.end)
            else:
                found.append(token)
        return found

    def kind_of(self, noun: str) -> frozenset[str]:
        """Return the objects that a synonym of their noun may name: "block" for `red cube`."""
        kinds = [kind for kind in NOUN_KINDS if noun in kind]
        return frozenset(name for kind in kinds for other in kind for name in self.objects_of.get(other, ()))

    def is_meant(self, name: str, words: Iterable[str]) -> bool:
        """Return whether these words of an object's name or alias suffice: noun, distinctive words, or adjectives.

        "The cup" does not name a cup holder, nor "the wine" a wine bottle.
        """
        said = frozenset(words)
        nouns = {noun_of(phrase) for phrase in self.phrases[name]}
        own = {word for word in self.phrases[name][0] if self.objects_of[word] == {name}}
        return bool(said & nouns) or said <= ADJECTIVES or (bool(own) and own <= said)

    def with_noun(self, noun: str) -> frozenset[str]:
        """Return the objects with a name or alias that ends in this noun."""
        return frozenset(name for name, phrases in self.phrases.items() if any(noun_of(p) == noun for p in phrases))

    def of_color(self, color: str) -> frozenset[str]:
        """Return the objects whose name or alias has a word for a similar color."""
        own = [word for word in self.objects_of if word in vocabulary.COLORS and vocabulary.look_alike(color, word)]
        return frozenset(name for word in own for name in self.objects_of[word])

    def _word(self, token: Token) -> Word:
        if (known := self._known(token.text)) is not None:
            return Word(token, known, plural=known in self._nouns and token.text in plurals_of(known))
        if not token.text[0].isalnum():
            return Word(token, token.text, known=token.text in FUNCTION_WORDS)
        right = self._speller.correct(token.text)
        if right is None:
            return Word(token, token.text, known=False)
        return Word(token, self._known(right) or right, corrected=True)

    def _known(self, text: str) -> str | None:
        """Return the base form of a known word; None for an unknown one."""
        if text in self.objects_of:
            return text
        if text in NUMBERS:
            return NUMBERS[text]
        if nouns := (plurals_of(text) | singulars_of(text)) & self._nouns:
            return min(nouns)
        if text in self._exact:
            return text
        return verbs.FORMS.get(text)

    @cached_property
    def _nouns(self) -> frozenset[str]:
        return frozenset({*self.objects_of, *_NOUNS} - FUNCTION_WORDS)

    @cached_property
    def _exact(self) -> frozenset[str]:
        colors = frozenset((*vocabulary.COLORS, *vocabulary.SHADES_OF, *vocabulary.IN_NAMES, *NUMBERS.values()))
        return colors | _NOUNS | verbs.PARTICLES | verbs.FIRST_WORDS | FUNCTION_WORDS | self._taught

    @cached_property
    def _open_compounds(self) -> dict[str, Phrase]:
        pairs = [pair for phrases in self.phrases.values() for phrase in phrases for pair in pairwise(phrase)]
        return {"".join(pair): pair for pair in pairs}

    @cached_property
    def _speller(self) -> Speller:
        return Speller((self.objects_of, self._taught, verbs.FIRST_WORDS, self._exact), self._is_word)


def noun_of(phrase: Phrase) -> str:
    """Return the last word that is no adjective: "drawer" of `drawer_top`."""
    return next((word for word in reversed(phrase) if word not in ADJECTIVES), phrase[-1])


def phrase_of(text: str) -> Phrase:
    """Return the words of a name or an alias."""
    return tuple(token.text for token in tokens_of(text))


def checked_aliases(aliases: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """Return the aliases by object, checked: each may stand in an instruction and belongs to one object only.

    Raises:
        InvalidInputError: names the alias and the object that has it already.
    """
    owners = {form: name for name in aliases for form in _singular_and_plurals(name)}
    for name, words in aliases.items():
        checked_name("aliases", name)
        for word in words:
            field = f"aliases[{name}]"
            forms = _singular_and_plurals(checked_name(field, word))
            owner = next((owners[form] for form in forms if owners.get(form, name) != name), name)
            owners |= dict.fromkeys(forms, owner)
            if owner != name:
                raise InvalidInputError(field, f"{word!r} stands for {owner!r} already", "a word of one object only")
    return {name: tuple(words) for name, words in aliases.items()}


def check_aliases_of(aliases: Mapping[str, Sequence[str]], names: Sequence[str]) -> None:
    """Refuse aliases of unknown objects, those that may be said of another object, too, and those that name nothing.

    With the alias "azure" for a red cube, beside a blue cube, "pick up the azure cube" could move the red one.

    Args:
        names: the task's objects.
    """
    for name, words in aliases.items():
        field = f"aliases[{name}]"
        if name not in names:
            raise InvalidInputError(field, "is no object of the task", ", ".join(names))
        for word in words:
            if vocabulary.NAMELESS.issuperset(phrase_of(word)):
                raise InvalidInputError(field, f"{word!r} names nothing by itself", "a noun")
            if other := next((other for other in names if other != name and _may_mean(other, word)), None):
                message = f"{word!r} is in the name of {other!r}, or its color"
                raise InvalidInputError(field, message, "words that fit no other object")


def shared_aliases(of_tasks: Sequence[Mapping[str, Sequence[str]]], names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return the aliases from several tasks, by object, without those that also fit another object of the scene.

    Args:
        of_tasks: the aliases of each task.
        names: the objects of the scene.
    """
    words = {name: tuple(dict.fromkeys(word for of in of_tasks for word in of.get(name, ()))) for name in names}

    def is_own(name: str, word: str) -> bool:
        others = (called for other in names if other != name for called in (other, *words[other]))
        return not any(_may_mean(called, word) for called in others)

    return {name: tuple(word for word in words[name] if is_own(name, word)) for name in names}


def _may_mean(name: str, words: str) -> bool:
    """Return whether the words may be said of an object with this name: a part of it, or a color like its own alone."""
    said = set(phrase_of(words)) - vocabulary.NAMELESS - vocabulary.SHADES_OF - vocabulary.COLORED
    own = vocabulary.COLORS.keys() & phrase_of(name)
    is_color = bool(said) and said <= vocabulary.COLORS.keys()
    return _contains(name, words) or (
        is_color and any(vocabulary.look_alike(one, other) for one in said for other in own)
    )


def _contains(name: str, words: str) -> bool:
    """Return whether the name contains the words, each in the singular or in the plural."""
    shown, said = folded_name(name).split(), folded_name(words).split()
    starts = range(len(shown) - len(said) + 1)
    return any(
        all(one in {other, *plurals_of(other), *singulars_of(other)} for one, other in zip(part, said, strict=True))
        for part in (shown[k : k + len(said)] for k in starts)
    )


def _singular_and_plurals(words: str) -> tuple[str, ...]:
    """Return the folded words, and the same with the last one in the plural."""
    said = folded_name(words)
    before, space, last = said.rpartition(" ")
    return (said, *(f"{before}{space}{plural}" for plural in plurals_of(last)))
