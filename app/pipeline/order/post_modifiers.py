"""Modifiers after a noun that say which object is meant: "next to the plate", "that is red", "third from the right"."""

from collections.abc import Iterator, Sequence

from app.pipeline.errors import UngroundedInstructionError
from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.descriptions import Description
from app.pipeline.order.lexicon import Lexicon
from app.pipeline.order.space import between, beyond, extreme, in_the_middle, next_to, on_side
from app.pipeline.order.words import Word

MAX_STEPS = 4000  # of one parse; an instruction that needs more is refused as too involved


class TooInvolvedError(UngroundedInstructionError):
    """The parse takes more than `MAX_STEPS` steps."""


class PostModifiers:
    """The modifiers after the nouns of one text.

    Args:
        words: of the text, in base form where the lexicon has them.
    """

    def __init__(self, words: Sequence[Word], lexicon: Lexicon) -> None:
        self.words = words
        self._texts = [word.text for word in words]
        self._lexicon = lexicon
        self._steps = 0

    def count_step(self) -> None:
        """Count one step of the parse.

        Raises:
            TooInvolvedError: after too many.
        """
        self._steps += 1
        if self._steps > MAX_STEPS:
            raise TooInvolvedError("instruction", "is too involved to be sure of", "fewer things at once")

    def _single(self, at: int) -> list[tuple[str, int]]:
        """Return the object and the end of each noun phrase that begins there."""
        raise NotImplementedError

    def _described(self, said: Description) -> Iterator[Description]:
        """Yield every continuation of a description: words up to the noun, then modifiers after it."""
        raise NotImplementedError

    def _modified(self, before: Description, *, is_predicate: bool = False) -> Iterator[Description]:
        """Yield the description extended by the next word."""
        raise NotImplementedError

    def _text(self, at: int) -> str:
        return self._texts[at] if at < len(self._texts) else ""

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
