"""Noun phrases of an instruction, and the object that each names.

    noun phrase = "it" | {determiner} {modifier} {relation}      of which a modifier must name an object or a noun
    modifier    = name or alias | word of a name | synonym of a noun | "one", "thing", ...
                | [shade] color ["colored"] | place | ordinal | "nearest", "farthest"
    relation    = ["that is"] ["directly"] (nearness | beside | side) | "that is" {modifier} | "of" ["the"] noun
    nearness    = ["nearest"] "to" landmark | "nearest" landmark | ["farthest"] ["away"] "from" landmark
                | "farthest" ["away"] ["to the" edge]
    beside      = "next to", "left of", "on", ... noun phrase | "between" noun phrase "and" noun phrase
    side        = "on", "at", "in" ["the"] ["far"] place ["side"] | "from" ["the"] place ["side"]
    landmark    = ["the"] "robot", "you", ... | noun phrase

Every parse is followed: each method yields a `Description` for each way in which the text goes on.
"""

from collections.abc import Iterable, Iterator, Sequence

from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.descriptions import MEANS, Description, NounPhrase, Unmatched
from app.pipeline.order.lexicon import Lexicon, Text
from app.pipeline.order.space import Layout, between, extreme, in_the_middle, on_side, related
from app.pipeline.order.vocabulary import COLORS


class NounPhrases:
    """The noun phrases of one instruction.

    Args:
        layout: where the objects are; None: no relation can be decided.

    Attributes:
        unmatched: the noun phrases that matched no single object.
    """

    def __init__(self, instruction: str, lexicon: Lexicon, layout: Layout | None) -> None:
        self.text = Text(instruction, lexicon)
        self.unmatched: set[Unmatched] = set()
        self._lexicon = lexicon
        self._layout = layout
        self._found: dict[int, tuple[NounPhrase, ...]] = {}

    def at(self, start: int) -> tuple[NounPhrase, ...]:
        """Return the noun phrases that begin there and match one object, the longest first, then the least certain."""
        if start not in self._found:
            self._found[start] = ()  # a phrase cannot be part of what it begins with
            found = dict.fromkeys(self._phrases(start))
            self._found[start] = tuple(sorted(found, key=lambda phrase: (-phrase.end, -MEANS.index(phrase.by))))
        return self._found[start]

    def with_names(self, phrases: Iterable[NounPhrase]) -> str:
        """Return the instruction with these phrases replaced by the objects' names."""
        text, words = self.text.instruction, self.text.words
        for start, end, name, *_ in sorted(set(phrases), key=lambda phrase: -phrase.start):
            if name is not None:
                before, after = text[: words[start].token.start], text[words[end - 1].token.end :]
                text = f"{before}the {name.replace('_', ' ')}{after}"
        return text

    def _phrases(self, start: int) -> Iterator[NounPhrase]:
        if self.text.at(start) == "it":
            yield NounPhrase(start, start + 1, None, "taught")
        first = start
        while self.text.at(first) in vocabulary.DETERMINERS and self.text.at(first) not in self._lexicon.objects_of:
            first += 1
        may_be_direction = first == start and not (start and self.text.at(start - 1) == "and")
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
        self.text.count_step()
        for more in self._modified(said):
            yield from self._described(more)
        if said.says_something:
            yield from self._related(said)

    def _related(self, said: Description) -> Iterator[Description]:
        self.text.count_step()
        relative = self.text.end(said.end, vocabulary.BEING) is not None
        for more in self._relations(said):
            unneeded = len(said.picks) if said.needed is None and not relative else said.needed
            yield from self._related(more._replace(needed=unneeded))
        yield said

    def _modified(self, before: Description, *, is_predicate: bool = False) -> Iterator[Description]:
        """Parse modifier: the next word, once for each of its meanings.

        Args:
            is_predicate: whether the word follows "that is", "which stands" etc.
        """
        at, text = before.end, self.text.at(before.end)
        if not text:
            return
        said = before._replace(end=at + 1, plural=before.plural or self.text.words[at].plural, nested=False)
        yield from self._whole_names(at, said)
        loose = self._lexicon.loose
        number = "1" if text == "one" and said.has_noun else ""  # "mug one"
        for own in sorted({text, number, vocabulary.IN_NAMES.get(text, text)} & loose - set(said.words)):
            if said.has_noun and own in vocabulary.PLACE_ADJECTIVES:
                continue  # "turn the tap left" names no left tap
            hand = own in ("left", "right") and self.text.at(at + 1) == "hand" and "hand" not in loose
            means = said.means if own in self._lexicon.name_words else said.means | {"alias"}
            yield said._replace(end=at + 1 + hand, words=(*said.words, own), means=means)
        if text in loose:
            return
        yield from self._colored(at, said)
        yield from self._placed(at, said, is_predicate)
        if text in vocabulary.GENERIC_NOUNS:
            yield said._replace(generic=True)
        elif self._lexicon.kind_of(text):
            yield said._replace(kinds=(*said.kinds, text))

    def _whole_names(self, at: int, said: Description) -> Iterator[Description]:
        for phrase in self._lexicon.called.all_at(self.text.texts, at) if said.exact is None else ():
            words = self.text.words[at : at + len(phrase)]
            plural = said.plural or any(word.plural for word in words)
            for name, by in self._lexicon.called[phrase]:
                yield said._replace(end=at + len(phrase), exact=name, plural=plural, means=said.means | {by})

    def _colored(self, at: int, said: Description) -> Iterator[Description]:
        text = self.text.at(at)
        by_color = said._replace(means=said.means | {"color"})
        if text in COLORS:
            yield by_color._replace(colors=(*said.colors, text))
        elif text in vocabulary.SHADES_OF and self.text.at(at + 1) in COLORS:
            yield by_color
        elif text in vocabulary.COLORED and self.text.at(at - 1) in COLORS:
            yield said

    def _placed(self, at: int, said: Description, is_predicate: bool) -> Iterator[Description]:
        text = self.text.at(at)
        place = next(vocabulary.PLACES.all_at(self.text.texts, at), ())
        # After the noun, "left" is a direction ("push the button left"); "leftmost" still describes the object.
        is_direction = said.has_noun and not is_predicate and not vocabulary.PLACE_ADJECTIVES.isdisjoint(place)
        if place and not is_direction:
            end = at + len(place)
            yield said.with_pick(vocabulary.PLACES[place], end)
            for side in vocabulary.EDGES.intersection(place) & self._lexicon.loose:  # a name may say so as well
                yield said._replace(end=end, words=(*said.words, side))
        if said.place and text in vocabulary.COUNTED_FROM and text.endswith("st"):
            yield said.counted_from(vocabulary.COUNTED_FROM[text], at + 1)
        if text in vocabulary.ORDINALS and said.place is None:
            yield said._replace(place=vocabulary.ORDINALS[text])
        if said.reach is None and (reach := vocabulary.REACHES.get(text)):
            yield said._replace(reach=reach, means=said.means | {"relation"})

    def _relations(self, said: Description) -> Iterator[Description]:
        introduced = self.text.end(said.end, vocabulary.BEING)
        if introduced is not None:
            for more in self._modified(said._replace(end=introduced), is_predicate=True):
                yield from self._described(more)
        start = said.end if introduced is None else introduced
        exactly = self.text.end(start, vocabulary.EXACTLY)
        on = ("on", "at", "from", "in") if introduced is None else ("on", "at", "from", "in", "to")
        for begin in (start,) if exactly is None else (start, exactly):
            yield from self._reaching(begin, said)
            yield from self._beside(begin, said)
            yield from self._on_a_side(begin, said, on)
        yield from self._of_several(said)

    def _reaching(self, at: int, said: Description) -> Iterator[Description]:
        reach = vocabulary.REACHES.get(self.text.at(at))
        if reach and said.reach is None:
            said, at = said._replace(reach=reach, means=said.means | {"relation"}), at + 1
            if reach == "near":
                yield from self._measured(at, said)
        if said.reach is None:
            return
        at = at + 1 if said.reach == "far" and self.text.at(at) == "away" else at
        if self.text.at(at) == ("to" if said.reach == "near" else "from"):
            yield from self._measured(at + 1, said)
        elif reach == "far":
            yield said.reaching(None, at)
            side = self.text.at(at + 2)
            if (self.text.at(at), self.text.at(at + 1)) == ("to", "the") and side in vocabulary.EDGES:
                far = said._replace(reach=None, place=None)
                yield far.with_pick(extreme(side, said.place or 1), at + 3)

    def _measured(self, at: int, said: Description) -> Iterator[Description]:
        end = self.text.end(at + 1 if self.text.at(at) == "the" else at, vocabulary.ROBOT)
        if end and self.text.at(end - 1) not in self._lexicon.objects_of:
            yield said.reaching(None, end)
        for name, end in self._named(at):
            yield said.reaching(name, end)

    def _beside(self, at: int, said: Description) -> Iterator[Description]:
        if (relation := next(vocabulary.RELATIONS.all_at(self.text.texts, at), None)) is not None:
            for name, after in self._named(at + len(relation)):
                pick = related(vocabulary.RELATIONS[relation], name)
                yield said.with_pick(pick, after, nested=True)
        for one, middle in self._named(at + 1) if self.text.at(at) == "between" else ():
            for other, after in self._named(middle + 1) if self.text.at(middle) == "and" else ():
                yield said.with_pick(between(one, other), after, nested=True)

    def _on_a_side(self, at: int, said: Description, prepositions: Sequence[str]) -> Iterator[Description]:
        """Parse side: "on the far left", "third from the right"; "to the left" alone is a direction."""
        preposition, start = self.text.at(at), at + 1
        if preposition not in prepositions:
            return
        start = start + 1 if self.text.at(start) in ("the", "your") else start
        very = self.text.at(start) in ("far", "very", "extreme")
        place = start + 1 if very else start
        side = self.text.at(place)
        end = self.text.end(place + 1, vocabulary.SIDES) or place + 1
        if preposition == "from":
            if side in vocabulary.COUNTED_FROM and said.place:
                yield said.counted_from(vocabulary.COUNTED_FROM[side], end)
            return
        if side in vocabulary.PLACE_ADJECTIVES & self._lexicon.loose and self._ends_phrase(end):
            yield said._replace(end=end, words=(*said.words, side))
        if side in ("middle", "center", "centre") and self._ends_phrase(place + 1):
            yield said.with_pick(in_the_middle, place + 1)
        elif side in vocabulary.EDGES and self.text.at(end) != "of" and self._ends_phrase(end):
            yield said.with_pick(extreme(side) if very else on_side(side), end)

    def _of_several(self, said: Description) -> Iterator[Description]:
        """Parse "of the buttons", "of them all" after a relation; the words add the noun."""
        at = said.end
        if self.text.at(at) != "of" or not (said.picks or said.reach or said.place):
            return
        if self.text.at(at + 1) in ("them", "all"):
            yield said._replace(end=at + (3 if self.text.at(at + 2) == "all" else 2), generic=True)
        start = at + 1
        while self.text.at(start) in ("the", "all", "these", "your"):
            start += 1
        word = self.text.at(start)
        if word in vocabulary.GENERIC_NOUNS:
            yield said._replace(end=start + 1, generic=True)
        elif word in self._lexicon.loose:
            yield said._replace(end=start + 1, words=(*said.words, word))

    def _ends_phrase(self, at: int) -> bool:
        """Return whether no noun follows: in "put the mug in the bottom drawer", "bottom" is no place of the mug."""
        text = self.text.at(at)
        return not text or text in vocabulary.FUNCTION_WORDS or text in verbs.FIRST_WORDS

    def _named(self, at: int) -> list[tuple[str, int]]:
        """Return the name and the end of each noun phrase that begins there."""
        return [(phrase.name, phrase.end) for phrase in self.at(at) if phrase.name is not None]
