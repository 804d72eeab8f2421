"""Parse the words of a text into clauses; yields every parse."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.clauses import DIRECT, INSTRUMENT, ParsedClause, without
from app.pipeline.order.noun_phrases import NounPhrase, NounPhrases
from app.pipeline.order.words import NUMBERS, PhraseTable

MAX_OBJECTS = 8  # of one role
_NEVER_FIXED = frozenset(["and", "but", "or", "nor", "not", "never", "then", "it", "again", "use"])


class ClauseParser:
    """The clauses of one instruction.

    Args:
        fixed: allowed words besides verb and objects; None: any (for taught instructions).
        taught_verbs: verbs of taught instructions that no table lists.
        of_steps: whether "before", "after", "all", "both", "each" and "except" may ask for several steps.
    """

    def __init__(
        self,
        phrases: NounPhrases,
        fixed: frozenset[str] | None,
        taught_verbs: frozenset[str],
        *,
        of_steps: bool = False,
    ) -> None:
        self._words = phrases.words
        self._of_steps = of_steps
        self._texts = [word.text for word in phrases.words]
        self._phrases = phrases
        self._fixed = fixed
        self._verbs = verbs.FIRST_WORDS | taught_verbs

    def _text(self, at: int) -> str:
        """The word there; empty at the end."""
        return "" if at >= len(self._texts) else self._texts[at]

    def _end(self, at: int, table: PhraseTable) -> int | None:
        return table.end_at(self._texts, at)

    def _skip(self, at: int, *tables: PhraseTable) -> int:
        """Where what says nothing ends."""
        while self._end(at, vocabulary.RATHER) is None:
            ends = [end for table in tables if (end := self._end(at, table)) is not None]
            if not ends:
                break
            at = max(ends)
            if self._text(at) == "," and at + 1 < len(self._texts):
                at += 1
        return at

    def _forbids(self, at: int) -> bool:
        """Whether what follows is what is not meant."""
        excepted = (vocabulary.EXCEPT,) if self._of_steps else ()
        return any(self._end(at, table) is not None for table in (vocabulary.RATHER, vocabulary.NOT, *excepted))

    def _separator(self, at: int) -> tuple[int, frozenset[str]]:
        """Where the marks and conjunctions end that stand here, and of which sorts they are."""
        sorts: set[str] = set()
        while text := self._text(at):
            if (end := self._end(at, vocabulary.THEN)) is not None:
                sorts.add("then")
                at = end
            elif text in ("and", "but", ",", ".", ";") or (text == "?" and self._is_all_asked(at + 1)):
                sorts.add(text if text in ("and", "but", ",") else "stop")
                at += 1
            elif self._of_steps and text in vocabulary.ORDERING:
                sorts.add(text)
                at += 1
            else:
                break
        return at, frozenset(sorts)

    def _is_all_asked(self, at: int) -> bool:
        """Return whether nothing but punctuation and fillers ("thanks") follows."""
        while text := self._text(at):
            end = at + 1 if text in vocabulary.MARKS else self._end(at, vocabulary.FILLERS)
            if end is None:
                return False
            at = end
        return True

    def _clauses_at(self, at: int, *, forbidden: bool) -> Iterator[tuple[ParsedClause, int]]:
        for verb, end in self._verb(at):
            yield from self._arguments(end, ParsedClause(verb), forbidden)
        yield from self._arguments(at, ParsedClause(None), forbidden)
        yield from self._passive(at, forbidden)
        used = self._text(at) == "use"  # "use the cloth to wipe the table"
        role, start = (INSTRUMENT, at + 1) if used else self._preposition(at)
        for phrases, end in self._objects(start, forbidden) if role else ():
            begin = end + 1 if self._text(end) == ("to" if used else ",") else end
            if used and begin == end:
                continue
            for verb, after in self._verb(self._skip(begin, vocabulary.FILLERS)):
                yield from self._arguments(after, ParsedClause(verb, ((role, phrases),)), forbidden)

    def _passive(self, at: int, forbidden: bool) -> Iterator[tuple[ParsedClause, int]]:
        """The red button should be pushed."""
        for phrases, end in self._objects(at, forbidden):
            if (begin := self._end(end, vocabulary.PASSIVE)) is not None:
                for verb, after in self._verb(begin, passive=True):
                    yield from self._arguments(after, ParsedClause(verb, ((DIRECT, phrases),)), forbidden)

    def _verb(self, at: int, *, passive: bool = False) -> Iterator[tuple[str, int]]:
        """Yield the verbs at this word in the imperative, or as a passive participle; "pushed" alone is a report."""
        for phrase in verbs.TABLE.all_at(self._texts, at):
            if self._has_form(at, phrase[0], passive=passive):
                yield " ".join(phrase), at + len(phrase)
        text = self._text(at)
        base = text if text in self._verbs else verbs.FORMS.get(text, "")  # "placed" is a word of places, too
        if base and (base != text or base not in verbs.PHRASES) and self._has_form(at, base, passive=passive):
            yield base, at + 1

    def _has_form(self, at: int, base: str, *, passive: bool) -> bool:
        """Return whether the verb is an imperative; in a taught instruction any form is accepted."""
        word = self._words[at]
        if self._fixed is None or passive or word.corrected or word.token.text == base:
            return True
        return word.token.text.endswith("ing") and at > 0 and self._text(at - 1) in vocabulary.BEFORE_GERUND

    def _arguments(self, at: int, clause: ParsedClause, forbidden: bool) -> Iterator[tuple[ParsedClause, int]]:
        """Yield the clause with every sequence of arguments that may follow, and where it ends."""
        self._phrases.count_step()
        start = self._skip(at, vocabulary.FILLERS_OF_FORBIDDEN if forbidden else vocabulary.FILLERS)
        role, after = self._preposition(start)
        for phrases, end in self._objects(after, forbidden) if role else ():
            if not clause.objects_in(role):
                yield from self._arguments(end, clause.with_objects(role, phrases, after_article=False), forbidden)
        if not clause.objects_in(DIRECT):
            after_article = self._text(start) in vocabulary.DETERMINERS
            for phrases, end in self._objects(start, forbidden):
                more = clause.with_objects(DIRECT, phrases, after_article=after_article)
                yield from self._arguments(end, more, forbidden)
        for phrases, end in self._objects(start, forbidden) if not clause.objects_in("of") else ():
            if self._text(end) == "'s":  # "the printer's button" is the button of the printer
                whole = clause.with_objects("of", phrases, after_article=False)
                yield from self._with_fixed(end + 1, whole, forbidden)
        if clause.objects_in(DIRECT) and f"{clause.verb} {self._text(start)}" in verbs.PHRASES:
            verb = f"{clause.verb} {self._text(start)}"
            yield from self._arguments(start + 1, replace(clause, verb=verb), forbidden)
        yield from self._with_fixed(start, clause, forbidden)
        if (clause.verb or clause.roles) and not clause.has_two_destinations and self._may_end(start):
            yield clause, start

    def _with_fixed(self, at: int, clause: ParsedClause, forbidden: bool) -> Iterator[tuple[ParsedClause, int]]:
        """Yield the clause with a further fixed word, and the preposition and article before it."""
        role, start = self._preposition(at)
        if start == at + 1 and self._may_end(start):
            role, start = "", at  # an adverb: "screw the cap on"
        while self._text(start) in vocabulary.SOME:
            start += 1
        if not self._text(start):
            return
        word = self._fixed_word(start)
        wanted = (*((f"{role}:",) if role else ()), word)
        if word and (self._fixed is None or self._fixed.issuperset(wanted)):
            yield from self._arguments(start + 1, clause.with_fixed(role, word), forbidden)
        elif word in vocabulary.RETURNING and not role:
            apart = replace(replace(clause, goes_on=False).with_fixed(role, word), goes_on=False)
            yield from self._arguments(start + 1, apart, forbidden)

    def _fixed_word(self, at: int) -> str:
        """Return the word as written, for "blocks" differs from "block"; "" for a word that may not be fixed."""
        word = self._words[at]
        if word.text in _NEVER_FIXED or not word.text[0].isalnum():
            return ""
        return word.text if word.corrected or word.text in NUMBERS.values() else word.token.text

    def _may_end(self, at: int) -> bool:
        separated = self._text(at) in ("", "again") or self._separator(at)[0] > at
        first = self._end(at, vocabulary.FIRST) is not None
        return separated or first or self._forbids(at) or next(self._verb(at), None) is not None

    def _preposition(self, at: int) -> tuple[str, int]:
        end = self._end(at, vocabulary.PREPOSITIONS)
        if end is None:
            return "", at
        return vocabulary.ROLES[tuple(self._texts[at:end])], end

    def _objects(self, at: int, forbidden: bool) -> Iterator[tuple[tuple[NounPhrase, ...], int]]:
        if self._of_steps and not forbidden and self._text(at) in vocabulary.QUANTIFIERS:
            yield from self._each(at)
        if self._of_steps and self._text(at) == "them":
            yield (NounPhrase(at, at + 1, None, "taught", plural=True),), at + 1
        both = self._text(at) == "both"
        for phrases, end in self._listed(at + both, forbidden):
            is_clear = _has_right_number(phrases) and not self._is_one_thing(phrases)
            if (is_clear or forbidden) and (not both or len(phrases) == 2):
                yield phrases, end

    def _each(self, at: int) -> Iterator[tuple[tuple[NounPhrase, ...], int]]:
        """Yield all objects that a noun phrase matches: "all red mugs", "both tubes", "each of the tubes"."""
        quantifier, start, of = self._text(at), at + 1, False
        while self._text(start) in ("of", "the"):
            start, of = start + 1, True
        self._phrases.at(start)
        found = sorted((each.end, each.candidates) for each in self._phrases.unmatched if each.start == start)
        for end, names in found:
            words = self._words[start:end]
            right_number = words[-1].plural == (quantifier in ("all", "both") or of)
            described = all(word.text not in vocabulary.FUNCTION_WORDS for word in words)
            if right_number and described and (len(names) == 2 or (len(names) > 2 and quantifier != "both")):
                group = tuple(NounPhrase(at, end, name, "name", plural=True) for name in names)
                yield group, end
                begin = self._end(end, vocabulary.EXCEPT)
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

    def _listed(self, at: int, forbidden: bool) -> Iterator[tuple[tuple[NounPhrase, ...], int]]:
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
