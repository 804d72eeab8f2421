"""Noun phrases of an instruction, and the object that each names."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from app.pipeline.errors import UngroundedInstructionError
from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.descriptions import MEANS, Description
from app.pipeline.order.lexicon import Lexicon
from app.pipeline.order.space import Layout, between, beyond, extreme, in_the_middle, next_to, on_side
from app.pipeline.order.vocabulary import COLORS, SHADES_OF
from app.pipeline.order.words import Word

MAX_STEPS = 4000  # of one parse; an instruction that needs more is refused as too involved


class TooInvolvedError(UngroundedInstructionError):
    """The parse takes more than `MAX_STEPS` steps."""


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


class NounPhrases:
    """The noun phrases of one instruction.

    Args:
        layout: where the objects are; None: no relation can be decided.

    Attributes:
        words: of the instruction, in base form where the lexicon has them.
        unmatched: the noun phrases that matched no single object.
    """

    def __init__(self, instruction: str, lexicon: Lexicon, layout: Layout | None) -> None:
        self.instruction = instruction
        self.words: Sequence[Word] = lexicon.read(instruction)
        self._texts = [word.text for word in self.words]
        self._lexicon = lexicon
        self._layout = layout
        self._found: dict[int, tuple[NounPhrase, ...]] = {}
        self._steps = 0
        self.unmatched: set[Unmatched] = set()

    def count_step(self) -> None:
        """Count one step of the parse.

        Raises:
            TooInvolvedError: after too many.
        """
        self._steps += 1
        if self._steps > MAX_STEPS:
            raise TooInvolvedError("instruction", "is too involved to be sure of", "fewer things at once")

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
        for phrase in sorted(set(phrases), key=lambda phrase: -phrase.start):
            start, end = self.words[phrase.start].token.start, self.words[phrase.end - 1].token.end
            if phrase.name is not None:
                text = f"{text[:start]}the {phrase.name.replace('_', ' ')}{text[end:]}"
        return text

    def _text(self, at: int) -> str:
        return self._texts[at] if at < len(self._texts) else ""

    def _phrases(self, start: int) -> Iterator[NounPhrase]:
        if self._text(start) == "it":
            yield NounPhrase(start, start + 1, None, "taught")
        first = start
        while self._text(first) in vocabulary.DETERMINERS and self._text(first) not in self._lexicon.objects_of:
            first += 1
        if first != start and self._text(start) in self._lexicon.objects_of:
            first = start
        for said in self._described(Description(first)):
            listed = start > 0 and self._text(start - 1) == "and"
            if first == start and not listed and said.is_place_alone:
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
            after = at + 2 if word in vocabulary.EDGES and self._text(at + 1) == "hand" else at + 1
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

    def _relations(self, said: Description) -> Iterator[Description]:
        introduced = vocabulary.BEING.end_at(self._texts, said.end)
        if introduced is not None:
            for more in self._modified(said._replace(end=introduced), is_predicate=True):
                yield from self._described(more)
        start = said.end if introduced is None else introduced
        exactly = vocabulary.EXACTLY.end_at(self._texts, start)
        on = ("on", "at", "from", "in") if introduced is None else ("on", "at", "from", "in", "to")
        for begin in (start,) if exactly is None else (start, exactly):
            yield from self._reaching(begin, said)
            yield from self._beside(begin, said)
            yield from self._on_a_side(begin, said, on)
        yield from self._of_several(said)

    def _reaching(self, at: int, said: Description) -> Iterator[Description]:
        reach = vocabulary.REACHES.get(self._text(at))
        if reach and said.reach is None:
            said, at = said._replace(reach=reach, means=said.means | {"relation"}), at + 1
            if reach == "near":
                yield from self._measured(at, said)
        if said.reach is None:
            return
        at = at + 1 if said.reach == "far" and self._text(at) == "away" else at
        if self._text(at) == ("to" if said.reach == "near" else "from"):
            yield from self._measured(at + 1, said)
        elif reach == "far":
            yield said.reaching(None, at)
            side = self._text(at + 2)
            if (self._text(at), self._text(at + 1)) == ("to", "the") and side in vocabulary.EDGES:
                far = said._replace(reach=None, place=None)
                yield far.with_pick(extreme(side, said.place or 1), at + 3)

    def _measured(self, at: int, said: Description) -> Iterator[Description]:
        start = at + 1 if self._text(at) == "the" else at
        if (end := vocabulary.ROBOT.end_at(self._texts, start)) and self._text(end - 1) not in self._lexicon.objects_of:
            yield said.reaching(None, end)
        for name, end in self._single(at):
            yield said.reaching(name, end)

    def _single(self, at: int) -> list[tuple[str, int]]:
        """Return the name and the end of each noun phrase that begins there."""
        return [(phrase.name, phrase.end) for phrase in self.at(at) if phrase.name is not None]

    def _beside(self, at: int, said: Description) -> Iterator[Description]:
        if (end := vocabulary.RELATIONS.end_at(self._texts, at)) is not None:
            side = vocabulary.SIDES_OF.get(tuple(self._texts[at:end]))
            for name, after in self._single(end):
                yield said.with_pick(beyond(side, name) if side else next_to(name), after, nested=True)
        for one, middle in self._single(at + 1) if self._text(at) == "between" else ():
            for other, after in self._single(middle + 1) if self._text(middle) == "and" else ():
                yield said.with_pick(between(one, other), after, nested=True)

    def _on_a_side(self, at: int, said: Description, prepositions: Sequence[str]) -> Iterator[Description]:
        """Parse "on the far left", "in the middle", "third from the right"; "to the left" alone is a direction."""
        preposition, start = self._text(at), at + 1
        if preposition not in prepositions:
            return
        start = start + 1 if self._text(start) in ("the", "your") else start
        very = self._text(start) in ("far", "very", "extreme")
        place = start + 1 if very else start
        side = self._text(place)
        end = vocabulary.SIDES.end_at(self._texts, place + 1) or place + 1
        if preposition == "from":
            if side in vocabulary.COUNTED_FROM and said.place:
                yield said.counted_from(vocabulary.COUNTED_FROM[side], end)
            return
        if side in vocabulary.PLACE_ADJECTIVES & self._lexicon.loose and self._ends_phrase(end):
            yield said._replace(end=end, words=(*said.words, side))
        if side in ("middle", "center", "centre") and self._ends_phrase(place + 1):
            yield said.with_pick(in_the_middle, place + 1)
        elif side in vocabulary.EDGES and self._text(end) != "of" and self._ends_phrase(end):
            yield said.with_pick(extreme(side) if very else on_side(side), end)

    def _ends_phrase(self, at: int) -> bool:
        """Return whether no noun follows: in "put the mug in the bottom drawer", "bottom" is no place of the mug."""
        text = self._text(at)
        return not text or text in vocabulary.FUNCTION_WORDS or text in verbs.FIRST_WORDS

    def _of_several(self, said: Description) -> Iterator[Description]:
        """Parse "of the buttons", "of them all" after a relation; the words add the noun."""
        at = said.end
        if self._text(at) != "of" or not (said.picks or said.reach or said.place):
            return
        if self._text(at + 1) in ("them", "all"):
            yield said._replace(end=at + (3 if self._text(at + 2) == "all" else 2), generic=True)
        start = at + 1
        while self._text(start) in ("the", "all", "these", "your"):
            start += 1
        word = self._text(start)
        if word in vocabulary.GENERIC_NOUNS:
            yield said._replace(end=start + 1, generic=True)
        elif word in self._lexicon.loose:
            yield said._replace(end=start + 1, words=(*said.words, word))
