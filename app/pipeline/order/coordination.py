"""Coordinated noun phrases, "the red and the blue button", and those of several objects, "all mugs"."""

from collections.abc import Iterator, Sequence

from app.pipeline.order import vocabulary
from app.pipeline.order.clauses import without
from app.pipeline.order.noun_phrases import NounPhrase, NounPhrases
from app.pipeline.order.words import PhraseTable

MAX_OBJECTS = 8  # of one role
Objects = tuple[tuple[NounPhrase, ...], int]  # and the end of their words


class Coordination:
    """The lists of noun phrases of one instruction.

    Args:
        of_steps: whether "before", "after", "all", "both", "each", "except" and "them" may ask for several steps.
    """

    def __init__(self, phrases: NounPhrases, *, of_steps: bool = False) -> None:
        self._phrases = phrases
        self._words = phrases.words
        self._texts = [word.text for word in phrases.words]
        self._of_steps = of_steps

    def _text(self, at: int) -> str:
        """Return the word there; empty at the end."""
        return "" if at >= len(self._texts) else self._texts[at]

    def _end(self, at: int, table: PhraseTable) -> int | None:
        return table.end_at(self._texts, at)

    def _preposition(self, at: int) -> tuple[str, int]:
        """Return the role of the preposition there, and its end; an empty role without one."""
        end = self._end(at, vocabulary.PREPOSITIONS)
        if end is None:
            return "", at
        return vocabulary.ROLES[tuple(self._texts[at:end])], end

    def _objects(self, at: int, forbidden: bool) -> Iterator[Objects]:
        """Yield the objects that a noun phrase or a list there names, and its end.

        Args:
            forbidden: whether the clause forbids something, so that it may also name things that are not known.
        """
        if self._of_steps and not forbidden and self._text(at) in vocabulary.QUANTIFIERS:
            yield from self._each(at)
        if self._of_steps and self._text(at) == "them":
            yield (NounPhrase(at, at + 1, None, "taught", plural=True),), at + 1
        both = self._text(at) == "both"
        for phrases, end in self._listed(at + both, forbidden):
            is_clear = _has_right_number(phrases) and not self._is_one_thing(phrases)
            if (is_clear or forbidden) and (not both or len(phrases) == 2):
                yield phrases, end

    def _each(self, at: int) -> Iterator[Objects]:
        """Yield all objects that a noun phrase matches: "all red mugs", "both tubes", "each of the tubes"."""
        quantifier, start = self._text(at), at + 1
        while self._text(start) in ("of", "the"):
            start += 1
        in_plural = quantifier in ("all", "both") or start > at + 1
        self._phrases.at(start)
        found = sorted((each.end, each.candidates) for each in self._phrases.unmatched if each.start == start)
        for end, names in found:
            words = self._words[start:end]
            described = all(word.text not in vocabulary.FUNCTION_WORDS for word in words)
            right_number = len(names) == 2 or (len(names) > 2 and quantifier != "both")
            if described and right_number and words[-1].plural == in_plural:
                group = tuple(NounPhrase(at, end, name, "name", plural=True) for name in names)
                yield group, end
                yield from self._excepting(group, end)

    def _excepting(self, group: tuple[NounPhrase, ...], at: int) -> Iterator[Objects]:
        """Parse "except the red one" right after a group, where a preposition continues the clause."""
        begin = self._end(at, vocabulary.EXCEPT)
        for excepted, after in () if begin is None else self._listed(begin, forbidden=False):
            if (left := without(group, excepted)) and self._preposition(after)[0]:
                yield left, after

    def _is_one_thing(self, phrases: Sequence[NounPhrase]) -> bool:
        """Return whether a list may name a single object.

        "The red and green button" may have two colors, and "the cup next to the plate and the bowl" two neighbors.
        """
        if any(phrase.nested for phrase in phrases[:-1]):
            return True
        first, last = phrases[0], phrases[-1]
        with_article = tuple(self._text(each.start) in vocabulary.DETERMINERS for each in (first, last))
        nouns = first.with_noun, last.with_noun
        return with_article == (True, False) and nouns == (False, True) and not last.plural

    def _listed(self, at: int, forbidden: bool) -> Iterator[Objects]:
        """Yield a noun phrase, and the lists that begin with it."""
        conjunctions = ("and", "or", "nor") if forbidden else ("and",)
        for phrase in self._object(at, forbidden):
            yield (phrase,), phrase.end
            comma = self._text(phrase.end) == ","
            last = self._text(phrase.end + comma) in conjunctions
            if not comma and not last:
                continue
            for others, end in self._listed(phrase.end + comma + last, forbidden):
                self._phrases.count_step()
                # only "and" ends a list: what a comma adds may as well be a correction
                if len(others) < MAX_OBJECTS and (last or len(others) > 1):
                    yield (phrase, *others), end

    def _object(self, at: int, forbidden: bool) -> tuple[NounPhrase, ...]:
        """Return the phrases that name one object; in a clause that forbids something also those that name none."""
        found = self._phrases.at(at)
        if not forbidden:
            return found
        named = [phrase for phrase in found if phrase.name is not None]
        none = (each for each in self._phrases.unmatched if each.start == at and not each.candidates and not named)
        return (*named, *(NounPhrase(at, each.end, None, "name") for each in sorted(none)))


def _has_right_number(phrases: Sequence[NounPhrase]) -> bool:
    """Return whether each phrase names one object: the last one may share its plural noun with those before."""
    *others, last = phrases
    shares_noun = bool(others) and not any(phrase.with_noun for phrase in others)
    return not any(phrase.plural for phrase in others) and (not last.plural or shares_noun)
