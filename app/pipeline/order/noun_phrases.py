"""Noun phrases: which object a stretch of words stands for."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from app.pipeline.errors import UngroundedInstructionError
from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.descriptions import MEANS, Description
from app.pipeline.order.lexicon import Lexicon
from app.pipeline.order.space import Layout, Pick, between, beyond, extreme, in_the_middle, next_to, on_side
from app.pipeline.order.vocabulary import COLORS, SHADES_OF
from app.pipeline.order.words import Word

MAX_STEPS = 4000  # of one parse; an instruction that needs more is too involved to be sure of


class TooInvolvedError(UngroundedInstructionError):
    """The parse takes more steps than it may."""


class NounPhrase(NamedTuple):
    """The words from `start` to `end` stand for `name`.

    Attributes:
        name: the object; None for "it" and "them", and for what is no object in a clause that forbids something.
        by: how it was found, one of `descriptions.MEANS`.
        plural: whether it stands for several, of which it may name the last: "the red and the blue buttons".
        with_noun: whether it has a noun, unlike "the red" in that.
    """

    start: int
    end: int
    name: str | None
    by: str
    plural: bool = False
    with_noun: bool = True


class Unmatched(NamedTuple):
    """The words from `start` to `end` read like an object, but stand for none of the task, or for several."""

    start: int
    end: int
    candidates: tuple[str, ...]


class _Said(NamedTuple):
    """A description and the word after it."""

    description: Description
    end: int


class NounPhrases:
    """The noun phrases of one instruction.

    Args:
        layout: where the objects are; None: no relation can be decided.

    Attributes:
        words: of the instruction, as far as they are known.
        unmatched: what read like an object and was none.
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
        """Called at every step of a parse.

        Raises:
            TooInvolvedError: after too many.
        """
        self._steps += 1
        if self._steps > MAX_STEPS:
            raise TooInvolvedError("instruction", "is too involved to be sure of", "fewer things at once")

    def at(self, start: int) -> tuple[NounPhrase, ...]:
        """The noun phrases that begin there and stand for one object, the longest first, then the least literal."""
        if start not in self._found:
            self._found[start] = ()  # a phrase cannot be part of what it begins with
            found = dict.fromkeys(self._phrases(start))
            self._found[start] = tuple(sorted(found, key=lambda phrase: (-phrase.end, -MEANS.index(phrase.by))))
        return self._found[start]

    def text_of(self, phrase: NounPhrase | Unmatched) -> str:
        """As it stands in the instruction."""
        return self.instruction[self.words[phrase.start].token.start : self.words[phrase.end - 1].token.end]

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
        for said in self._described(_Said(Description(), first)):
            description = said.description
            listed = start > 0 and self._text(start - 1) == "and"
            if first == start and not listed and description.is_place_alone:
                continue  # "turn left" is a direction, "the top and bottom" are things
            candidates = description.candidates(self._lexicon, self._layout)
            if len(candidates) == 1:
                by, plural, with_noun = description.by(), description.plural, description.has_noun
                yield NounPhrase(start, said.end, candidates[0], by, plural, with_noun)
            else:
                self.unmatched.add(Unmatched(start, said.end, candidates))

    def _described(self, said: _Said) -> Iterator[_Said]:
        """What may be said from here on: more of the words before and with the noun, then relations after it."""
        self.count_step()
        for more in self._modified(said):
            yield from self._described(more)
        if said.description.says_something:
            yield from self._related(said)

    def _related(self, said: _Said) -> Iterator[_Said]:
        self.count_step()
        for more in self._relations(said):
            yield from self._related(more)
        yield said

    def _modified(self, said: _Said) -> Iterator[_Said]:
        """With the next word, in every way that it can be meant."""
        at, before = said.end, said.description
        text = self._text(at)
        if not text:
            return
        means = before.means | ({"spelling"} if self.words[at].corrected else set())
        description = before._replace(means=means, plural=before.plural or self.words[at].plural)
        yield from self._whole_names(at, description)
        loose = self._lexicon.loose
        for word in sorted({text, vocabulary.PLACES_IN_NAMES.get(text, text)} & loose - set(description.words)):
            if before.has_noun and word in vocabulary.PLACE_ADJECTIVES:
                continue  # "turn the tap left" names no left tap
            means = description.means if word in self._lexicon.name_words else description.means | {"alias"}
            yield _Said(description._replace(words=(*description.words, word), means=means), at + 1)
        if text in loose:
            return
        yield from self._colored(at, description)
        yield from self._placed(at, description)
        if text in vocabulary.GENERIC_NOUNS:
            yield _Said(description._replace(generic=True), at + 1)
        elif self._lexicon.kind_of(text):
            yield _Said(description._replace(kinds=(*description.kinds, text)), at + 1)

    def _whole_names(self, at: int, description: Description) -> Iterator[_Said]:
        if description.exact is None:
            for phrase in self._lexicon.table.all_at(self._texts, at):
                said = self.words[at : at + len(phrase)]
                plural = description.plural or any(word.plural for word in said)
                guessed = {"spelling"} if any(word.corrected for word in said) else set()
                for name, by in self._lexicon.called[phrase]:
                    means = description.means | guessed | {by}
                    yield _Said(description._replace(exact=name, plural=plural, means=means), at + len(phrase))

    def _colored(self, at: int, description: Description) -> Iterator[_Said]:
        text, after = self._text(at), self._text(at + 1)
        by_color = description._replace(means=description.means | {"color"})
        if text in COLORS:
            yield _Said(by_color._replace(colors=(*description.colors, text)), at + 1)
        elif text in SHADES_OF and after in COLORS:
            yield _Said(by_color, at + 1)
        elif text in vocabulary.COLORED and self._text(at - 1) in COLORS:
            yield _Said(description, at + 1)

    def _placed(self, at: int, description: Description) -> Iterator[_Said]:
        text = self._text(at)
        if (end := vocabulary.PLACES.end_at(self._texts, at)) is not None:
            said = tuple(self._texts[at:end])
            yield _Said(description.with_pick(vocabulary.PICKS[said]), end)
            for side in vocabulary.EDGES.intersection(said) & self._lexicon.loose:  # a name may say so as well
                yield _Said(description._replace(words=(*description.words, side)), end)
        if description.place and text in vocabulary.COUNTED_FROM and text.endswith("st"):
            yield _Said(description.counted_from(vocabulary.COUNTED_FROM[text]), at + 1)
        if text in vocabulary.ORDINALS and description.place is None:
            yield _Said(description._replace(place=vocabulary.ORDINALS[text]), at + 1)
        for words, reach in ((vocabulary.NEAR, "near"), (vocabulary.FAR, "far")):
            if text in words and description.reach is None:
                yield _Said(description._replace(reach=reach, means=description.means | {"relation"}), at + 1)

    def _relations(self, said: _Said) -> Iterator[_Said]:
        """With what follows the noun."""
        at = said.end
        introduced = vocabulary.BEING.end_at(self._texts, at)
        if introduced is not None:
            for more in self._modified(_Said(said.description, introduced)):
                yield from self._described(more)
        start = at if introduced is None else introduced
        exactly = vocabulary.EXACTLY.end_at(self._texts, start)
        on = ("on", "at", "from", "in") if introduced is None else ("on", "at", "from", "in", "to")
        for begin in (start,) if exactly is None else (start, exactly):
            yield from self._reaching(begin, said.description)
            yield from self._beside(begin, said.description)
            yield from self._on_a_side(begin, said.description, on)
        yield from self._of_several(at, said.description)

    def _reaching(self, at: int, description: Description) -> Iterator[_Said]:
        """Nearest to, farthest from: the robot or an object."""
        text = self._text(at)
        reach = "near" if text in vocabulary.NEAR else "far" if text in vocabulary.FAR else None
        if reach and description.reach is None:
            description, at = description._replace(reach=reach, means=description.means | {"relation"}), at + 1
            if reach == "near":
                yield from self._measured(at, description)
        if description.reach is None:
            return
        at = at + 1 if description.reach == "far" and self._text(at) == "away" else at
        if self._text(at) == ("to" if description.reach == "near" else "from"):
            yield from self._measured(at + 1, description)
        elif reach == "far":
            yield _Said(description.reaching(None), at)
            side = self._text(at + 2)
            if (self._text(at), self._text(at + 1)) == ("to", "the") and side in vocabulary.EDGES:
                far = description._replace(reach=None, place=None)
                yield _Said(far.with_pick(extreme(side, description.place or 1)), at + 3)

    def _measured(self, at: int, description: Description) -> Iterator[_Said]:
        start = at + 1 if self._text(at) == "the" else at
        if (end := vocabulary.ROBOT.end_at(self._texts, start)) and self._text(end - 1) not in self._lexicon.objects_of:
            yield _Said(description.reaching(None), end)
        for name, end in self._single(at):
            yield _Said(description.reaching(name), end)

    def _single(self, at: int) -> Iterator[tuple[str, int]]:
        for phrase in self.at(at):
            if phrase.name is not None:
                yield phrase.name, phrase.end

    def _beside(self, at: int, description: Description) -> Iterator[_Said]:
        """Next to, behind, left of an object; between two."""
        if (end := vocabulary.RELATIONS.end_at(self._texts, at)) is not None:
            side = vocabulary.SIDES_OF.get(tuple(self._texts[at:end]))
            for name, after in self._single(end):
                yield _Said(description.with_pick(beyond(side, name) if side else next_to(name)), after)
        if self._text(at) == "between":
            for one, middle in self._single(at + 1):
                if self._text(middle) == "and":
                    for other, after in self._single(middle + 1):
                        yield _Said(description.with_pick(between(one, other)), after)

    def _on_a_side(self, at: int, description: Description, prepositions: Sequence[str]) -> Iterator[_Said]:
        """On the far left, in the middle, third from the right; "to the left" alone is where something is pushed."""
        preposition, start = self._text(at), at + 1
        if preposition not in prepositions:
            return
        start = start + 1 if self._text(start) in ("the", "your") else start
        very = self._text(start) in ("far", "very", "extreme")
        place = start + 1 if very else start
        side = self._text(place)
        end = vocabulary.SIDES.end_at(self._texts, place + 1) or place + 1
        if preposition == "from":
            if side in vocabulary.COUNTED_FROM and description.place:
                yield _Said(description.counted_from(vocabulary.COUNTED_FROM[side]), end)
            return
        if side in vocabulary.PLACE_ADJECTIVES & self._lexicon.loose and self._ends_phrase(end):
            yield _Said(description._replace(words=(*description.words, side)), end)
        if side in ("middle", "center", "centre") and self._ends_phrase(place + 1):
            yield _Said(description.with_pick(in_the_middle), place + 1)
        elif side in vocabulary.EDGES and self._text(end) != "of" and self._ends_phrase(end):
            pick: Pick = extreme(side) if very else on_side(side)
            yield _Said(description.with_pick(pick), end)

    def _ends_phrase(self, at: int) -> bool:
        """Whether no noun follows: "put the mug in the bottom drawer" does not say where the mug is."""
        text = self._text(at)
        return not text or text in vocabulary.FUNCTION_WORDS or text in verbs.FIRST_WORDS

    def _of_several(self, at: int, description: Description) -> Iterator[_Said]:
        """Of the buttons, of them all: says among which, which the noun says as well."""
        if self._text(at) != "of" or not (description.picks or description.reach or description.place):
            return
        if self._text(at + 1) in ("them", "all"):
            yield _Said(description._replace(generic=True), at + (3 if self._text(at + 2) == "all" else 2))
        start = at + 1
        while self._text(start) in ("the", "all", "these", "your"):
            start += 1
        word = self._text(start)
        if word in vocabulary.GENERIC_NOUNS:
            yield _Said(description._replace(generic=True), start + 1)
        elif word in self._lexicon.loose:
            yield _Said(description._replace(words=(*description.words, word)), start + 1)
