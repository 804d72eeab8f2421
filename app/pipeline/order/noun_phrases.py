"""Noun phrases of an instruction, and the object that each names."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from app.pipeline.order import vocabulary
from app.pipeline.order.descriptions import MEANS, Description
from app.pipeline.order.lexicon import Lexicon
from app.pipeline.order.post_modifiers import PostModifiers
from app.pipeline.order.space import Layout
from app.pipeline.order.vocabulary import COLORS, SHADES_OF


class NounPhrase(NamedTuple):
    """The words from `start` to `end` stand for `name`.

    Attributes:
        name: of the object; None for "it" and "them", and for an unknown thing in a clause that forbids something.
        by: how it was matched, one of `descriptions.MEANS`.
        plural: whether its noun is in the plural, as the last one of "the red and the blue buttons".
        with_noun: whether it has a noun, unlike "the red" there.
        nested: whether it ends with another noun phrase: "the cup next to the plate".
        superfluous: whether it names the object without the relation at its end, which may then be a destination:
            "put mug 1 next to mug 2 on the tray".
    """

    start: int
    end: int
    name: str | None
    by: str
    plural: bool = False
    with_noun: bool = True
    nested: bool = False
    superfluous: bool = False


class Unmatched(NamedTuple):
    """The words from `start` to `end` are a noun phrase that matches no object of the task, or several."""

    start: int
    end: int
    candidates: tuple[str, ...]


class NounPhrases(PostModifiers):
    """The noun phrases of one instruction.

    Args:
        layout: where the objects are; None: no relation can be decided.

    Attributes:
        words: of the instruction, in base form where the lexicon has them.
        unmatched: the noun phrases that matched no single object.
    """

    def __init__(self, instruction: str, lexicon: Lexicon, layout: Layout | None) -> None:
        super().__init__(lexicon.read(instruction), lexicon)
        self.instruction = instruction
        self.unmatched: set[Unmatched] = set()
        self._layout = layout
        self._found: dict[int, tuple[NounPhrase, ...]] = {}

    def at(self, start: int) -> tuple[NounPhrase, ...]:
        """Return the noun phrases that begin there and match one object, the longest first, then the least certain."""
        if start not in self._found:
            self._found[start] = ()  # a phrase cannot be part of what it begins with
            found = dict.fromkeys(self._phrases(start))
            self._found[start] = tuple(sorted(found, key=lambda phrase: (-phrase.end, -MEANS.index(phrase.by))))
        return self._found[start]

    def text_of(self, start: int, end: int) -> str:
        """Return the characters of the words from `start` to `end`, as they were written."""
        return self.instruction[self.words[start].token.start : self.words[end - 1].token.end]

    def with_names(self, phrases: Iterable[NounPhrase]) -> str:
        """Return the instruction with these phrases replaced by the objects' names."""
        text = self.instruction
        for start, end, name, *_ in sorted(set(phrases), key=lambda phrase: -phrase.start):
            if name is not None:
                before, after = text[: self.words[start].token.start], text[self.words[end - 1].token.end :]
                text = f"{before}the {name.replace('_', ' ')}{after}"
        return text

    def _phrases(self, start: int) -> Iterator[NounPhrase]:
        if self._text(start) == "it":
            yield NounPhrase(start, start + 1, None, "taught")
        first = start
        while self._text(first) in vocabulary.DETERMINERS and self._text(first) not in self._lexicon.objects_of:
            first += 1
        may_be_direction = first == start and not (start and self._text(start - 1) == "and")
        for said in self._described(Description(first)):
            if may_be_direction and said.is_place_alone:
                continue  # "turn left" is a direction, "the top and bottom" are things
            candidates = said.candidates(self._lexicon, self._layout)
            if len(candidates) == 1:
                superfluous = said.is_superfluous(self._lexicon, self._layout)
                kind = said.plural, said.has_noun, said.nested, superfluous
                yield NounPhrase(start, said.end, candidates[0], said.by(), *kind)
            else:
                self.unmatched.add(Unmatched(start, said.end, candidates))

    def _described(self, said: Description) -> Iterator[Description]:
        """Yield every continuation: further words before the noun and the noun, then relations after it."""
        self.count_step()
        for more in self._modified(said):
            yield from self._described(more)
        if said.says_something:
            yield from self._related(said)

    def _related(self, said: Description) -> Iterator[Description]:
        self.count_step()
        relative = vocabulary.BEING.end_at(self._texts, said.end) is not None
        for more in self._relations(said):
            unneeded = len(said.picks) if said.needed is None and not relative else said.needed
            yield from self._related(more._replace(needed=unneeded))
        yield said

    def _modified(self, before: Description, *, is_predicate: bool = False) -> Iterator[Description]:
        """Yield the description extended by the next word, once for each meaning of the word.

        Args:
            is_predicate: whether the word follows "that is", "which stands" etc.
        """
        at, text = before.end, self._text(before.end)
        if not text:
            return
        means = before.means | ({"spelling"} if self.words[at].corrected else set())
        said = before._replace(end=at + 1, means=means, plural=before.plural or self.words[at].plural, nested=False)
        yield from self._whole_names(at, said)
        loose = self._lexicon.loose
        number = "1" if text == "one" and said.has_noun else ""  # "mug one"
        for word in sorted({text, number, vocabulary.IN_NAMES.get(text, text)} & loose - set(said.words)):
            if said.has_noun and word in vocabulary.PLACE_ADJECTIVES:
                continue  # "turn the tap left" names no left tap
            hand = word in ("left", "right") and self._text(at + 1) == "hand" and "hand" not in loose
            after = at + 1 + hand
            means = said.means if word in self._lexicon.name_words else said.means | {"alias"}
            yield said._replace(end=after, words=(*said.words, word), means=means)
        if text in loose:
            return
        yield from self._colored(at, said)
        yield from self._placed(at, said, is_predicate)
        if text in vocabulary.GENERIC_NOUNS:
            yield said._replace(generic=True)
        elif self._lexicon.kind_of(text):
            yield said._replace(kinds=(*said.kinds, text))

    def _whole_names(self, at: int, said: Description) -> Iterator[Description]:
        for phrase in self._lexicon.table.all_at(self._texts, at) if said.exact is None else ():
            words = self.words[at : at + len(phrase)]
            plural = said.plural or any(word.plural for word in words)
            guessed = {"spelling"} if any(word.corrected for word in words) else set()
            for name, by in self._lexicon.called[phrase]:
                yield said._replace(end=at + len(phrase), exact=name, plural=plural, means=said.means | guessed | {by})

    def _colored(self, at: int, said: Description) -> Iterator[Description]:
        text = self._text(at)
        by_color = said._replace(means=said.means | {"color"})
        if text in COLORS:
            yield by_color._replace(colors=(*said.colors, text))
        elif text in SHADES_OF and self._text(at + 1) in COLORS:
            yield by_color
        elif text in vocabulary.COLORED and self._text(at - 1) in COLORS:
            yield said

    def _placed(self, at: int, said: Description, is_predicate: bool) -> Iterator[Description]:
        text = self._text(at)
        end = vocabulary.PLACES.end_at(self._texts, at)
        place = tuple(self._texts[at:end])
        # After the noun, "left" is a direction ("push the button left"); "leftmost" still describes the object.
        is_direction = said.has_noun and not is_predicate and not vocabulary.PLACE_ADJECTIVES.isdisjoint(place)
        if end is not None and not is_direction:
            yield said.with_pick(vocabulary.PICKS[place], end)
            for side in vocabulary.EDGES.intersection(place) & self._lexicon.loose:  # a name may say so as well
                yield said._replace(end=end, words=(*said.words, side))
        if said.place and text in vocabulary.COUNTED_FROM and text.endswith("st"):
            yield said.counted_from(vocabulary.COUNTED_FROM[text], at + 1)
        if text in vocabulary.ORDINALS and said.place is None:
            yield said._replace(place=vocabulary.ORDINALS[text])
        if said.reach is None and (reach := vocabulary.REACHES.get(text)):
            yield said._replace(reach=reach, means=said.means | {"relation"})

    def _single(self, at: int) -> list[tuple[str, int]]:
        """Return the name and the end of each noun phrase that begins there."""
        return [(phrase.name, phrase.end) for phrase in self.at(at) if phrase.name is not None]
