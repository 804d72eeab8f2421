"""Clauses of an instruction: a verb, lists of objects in roles, and fixed words.

    clause   = [verb] {argument} | passive | fronted
    passive  = objects "should be" participle {argument}
    fronted  = preposition objects "," verb {argument} | "use" objects "to" verb {argument}
    argument = [preposition] objects | particle | [preposition] [article] fixed word | objects "'s" fixed word
    objects  = ["both"] noun phrase {("," | "and" | ", and") noun phrase} | several | "them"
    several  = ("all" | "both" | "each" | "every") ["of"] ["the"] noun phrase ["except" objects]

Fixed words are those of taught instructions that name no object. Politeness may stand before every argument.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.clauses import DIRECT, INSTRUMENT, ParsedClause, without
from app.pipeline.order.descriptions import NounPhrase
from app.pipeline.order.forms import VERB_FORMS, verb_forms
from app.pipeline.order.noun_phrases import NounPhrases
from app.pipeline.order.vocabulary import NUMBERS, PhraseTable

MAX_OBJECTS = 8  # of one role
Parsed = Iterator[tuple[ParsedClause, int]]  # clauses, and where their words end
Objects = Iterator[tuple[tuple[NounPhrase, ...], int]]  # objects, and where their words end


class Accepted(NamedTuple):
    """What clauses may have besides objects and the words that all tasks share.

    Attributes:
        verbs: of taught instructions, also those that no table lists.
        fixed: words of taught instructions besides verb and objects, and "role:" of their prepositions; None: any word.
        of_steps: whether "before", "after", "all", "both", "each", "except" and "them" may ask for several steps.
    """

    verbs: frozenset[str]
    fixed: frozenset[str] | None = frozenset()
    of_steps: bool = False


class ClauseParser:
    """The clauses of one instruction.

    Args:
        forbidden: whether the clauses forbid something, so that they may also name things that are not known.
    """

    def __init__(self, phrases: NounPhrases, accepted: Accepted, *, forbidden: bool = False) -> None:
        self._phrases = phrases
        self._text = phrases.text
        self._fixed = accepted.fixed
        self._verbs = verbs.FIRST_WORDS | accepted.verbs
        self._base_of = {form: verb for verb in accepted.verbs for form in verb_forms(verb)} | VERB_FORMS
        self._of_steps = accepted.of_steps
        self._forbidden = forbidden

    def at(self, start: int) -> Parsed:
        """Yield every clause that begins at this word, and where it ends."""
        for verb, end in self._verb(start):
            yield from self._arguments(end, ParsedClause(verb))
        yield from self._arguments(start, ParsedClause(None))
        yield from self._passive(start)
        yield from self._fronted(start)

    def skip(self, at: int, *tables: PhraseTable[Any]) -> int:
        """Return the end of the phrases of these tables that stand there, with a comma after each."""
        while self._text.end(at, vocabulary.RATHER) is None:
            ends = [end for table in tables if (end := self._text.end(at, table)) is not None]
            if not ends:
                break
            at = max(ends)
            if self._text.at(at) == "," and at + 1 < len(self._text.texts):
                at += 1
        return at

    def forbids(self, at: int) -> bool:
        """Return whether words of negation or exception follow."""
        excepted = (vocabulary.EXCEPT,) if self._of_steps else ()
        return any(self._text.end(at, table) is not None for table in (vocabulary.RATHER, vocabulary.NOT, *excepted))

    def separator(self, at: int) -> tuple[int, frozenset[str]]:
        """Return the end of the punctuation and conjunctions that stand there, and their kinds."""
        kinds: set[str] = set()
        while text := self._text.at(at):
            if (end := self._text.end(at, vocabulary.THEN)) is not None:
                kinds.add("then")
                at = end
            elif text in ("and", "but", ",", ".", ";"):
                kinds.add(text if text in ("and", "but", ",") else "stop")
                at += 1
            elif self._of_steps and text in vocabulary.ORDERING:
                kinds.add(text)
                at += 1
            else:
                break
        return at, frozenset(kinds)

    def is_one_thing(self, phrases: Sequence[NounPhrase]) -> bool:
        """Return whether a list may name a single object.

        "The red and green button" may have two colors, and "the cup next to the plate and the bowl" two neighbors.
        """
        if any(phrase.nested for phrase in phrases[:-1]):
            return True
        first, last = phrases[0], phrases[-1]
        with_article = tuple(self._text.at(each.start) in vocabulary.DETERMINERS for each in (first, last))
        nouns = first.with_noun, last.with_noun
        return with_article == (True, False) and nouns == (False, True) and not last.plural

    def _may_end(self, at: int) -> bool:
        separated = self._text.at(at) in ("", "again") or self.separator(at)[0] > at
        first = self._text.end(at, vocabulary.FIRST) is not None
        return separated or first or self.forbids(at) or next(self._verb(at), None) is not None

    def _passive(self, at: int) -> Parsed:
        """Parse "the red button should be pushed"."""
        for phrases, end in self._objects(at):
            if (begin := self._text.end(end, vocabulary.PASSIVE)) is not None:
                for verb, after in self._verb(begin, passive=True):
                    yield from self._arguments(after, ParsedClause(verb, ((DIRECT, phrases),)))

    def _fronted(self, at: int) -> Parsed:
        """Parse "on the plate, put the mug" and "use the cloth to wipe the table"."""
        used = self._text.at(at) == "use"
        role, start = (INSTRUMENT, at + 1) if used else self._preposition(at)
        for phrases, end in self._objects(start) if role else ():
            introduced = self._text.at(end) == ("to" if used else ",")
            if used and not introduced:
                continue
            for verb, after in self._verb(self.skip(end + introduced, vocabulary.FILLERS)):
                yield from self._arguments(after, ParsedClause(verb, ((role, phrases),)))

    def _verb(self, at: int, *, passive: bool = False) -> Iterator[tuple[str, int]]:
        """Yield the verbs at this word in the imperative, or as a passive participle; "pushed" alone is a report."""
        for phrase in verbs.TABLE.all_at(self._text.texts, at):
            if self._has_form(at, phrase[0], passive=passive):
                yield " ".join(phrase), at + len(phrase)
        text = self._text.at(at)
        base = text if text in self._verbs else self._base_of.get(text, "")  # "placed" is a word of places, too
        if base and (base != text or base not in verbs.PHRASES) and self._has_form(at, base, passive=passive):
            yield base, at + 1

    def _has_form(self, at: int, base: str, *, passive: bool) -> bool:
        """Return whether the verb is an imperative; in a taught instruction any form is accepted."""
        word = self._text.words[at]
        if self._fixed is None or passive or word.token.text == base:
            return True
        return word.token.text.endswith("ing") and at > 0 and self._text.at(at - 1) in vocabulary.BEFORE_GERUND

    def _arguments(self, at: int, clause: ParsedClause) -> Parsed:
        self._text.count_step()
        start = self.skip(at, vocabulary.FILLERS_OF_FORBIDDEN if self._forbidden else vocabulary.FILLERS)
        for more, end in self._argument(start, clause):
            yield from self._arguments(end, more)
        if (clause.verb or clause.roles) and not clause.has_two_destinations and self._may_end(start):
            yield clause, start

    def _argument(self, at: int, clause: ParsedClause) -> Parsed:
        role, start = self._preposition(at)
        for phrases, end in self._objects(start) if role and not clause.objects_in(role) else ():
            yield clause.with_objects(role, phrases, after_article=False), end
        if not clause.objects_in(DIRECT):
            after_article = self._text.at(at) in vocabulary.DETERMINERS
            for phrases, end in self._objects(at):
                yield clause.with_objects(DIRECT, phrases, after_article=after_article), end
        if "'s" in self._text.texts[at:] and not clause.objects_in("of"):
            for phrases, end in self._objects(at):  # "the printer's button" is the button of the printer
                if self._text.at(end) == "'s":
                    yield from self._fixed_word(end + 1, clause.with_objects("of", phrases, after_article=False))
        if clause.objects_in(DIRECT) and (verb := f"{clause.verb} {self._text.at(at)}") in verbs.PHRASES:
            yield replace(clause, verb=verb), at + 1
        yield from self._fixed_word(at, clause)

    def _fixed_word(self, at: int, clause: ParsedClause) -> Parsed:
        """Parse [preposition] [article] fixed word."""
        role, start = self._preposition(at)
        if start == at + 1 and self._may_end(start):
            role, start = "", at  # an adverb: "screw the cap on"
        returns = self._text.at(start) in vocabulary.RETURNING and not clause.has_destination
        while self._text.at(start) in vocabulary.SOME:
            start += 1
        word = self._text.words[start] if self._text.at(start) else None
        if word is None or word.text in vocabulary.NEVER_FIXED or not word.text[0].isalnum():
            return
        # as written, for "blocks" differs from "block"
        said = word.text if word.text in NUMBERS.values() else word.token.text
        if self._fixed is None or self._fixed.issuperset((f"{role}:", said) if role else (said,)):
            yield clause.with_fixed(role, said), start + 1
        elif returns and not role:
            yield replace(replace(clause, goes_on=False).with_fixed(role, said), goes_on=False), start + 1

    def _preposition(self, at: int) -> tuple[str, int]:
        phrase = next(vocabulary.PREPOSITIONS.all_at(self._text.texts, at), None)
        return (vocabulary.PREPOSITIONS[phrase], at + len(phrase)) if phrase else ("", at)

    def _objects(self, at: int) -> Objects:
        if self._of_steps and not self._forbidden and self._text.at(at) in vocabulary.QUANTIFIERS:
            yield from self._several(at)
        if self._of_steps and self._text.at(at) == "them":
            yield (NounPhrase(at, at + 1, None, "taught", plural=True),), at + 1
        both = self._text.at(at) == "both"
        for phrases, end in self._list(at + both):
            is_clear = _has_right_number(phrases) and not self.is_one_thing(phrases)
            if (is_clear or self._forbidden) and (not both or len(phrases) == 2):
                yield phrases, end

    def _several(self, at: int) -> Objects:
        """Parse several: "all red mugs", "both tubes", "each of the tubes"."""
        quantifier, start = self._text.at(at), at + 1
        while self._text.at(start) in ("of", "the"):
            start += 1
        in_plural = quantifier in ("all", "both") or start > at + 1
        self._phrases.at(start)
        found = sorted((each.end, each.candidates) for each in self._phrases.unmatched if each.start == start)
        for end, names in found:
            words = self._text.words[start:end]
            described = all(word.text not in vocabulary.FUNCTION_WORDS for word in words)
            right_number = len(names) == 2 or (len(names) > 2 and quantifier != "both")
            if described and right_number and words[-1].plural == in_plural:
                group = tuple(NounPhrase(at, end, name, "name", plural=True) for name in names)
                yield group, end
                begin = self._text.end(end, vocabulary.EXCEPT)
                for excepted, after in () if begin is None else self._list(begin):
                    if (left := without(group, excepted)) and self._preposition(after)[0]:
                        yield left, after

    def _list(self, at: int) -> Objects:
        conjunctions = ("and", "or", "nor") if self._forbidden else ("and",)
        for phrase in self._object(at):
            yield (phrase,), phrase.end
            comma = self._text.at(phrase.end) == ","
            last = self._text.at(phrase.end + comma) in conjunctions
            if not comma and not last:
                continue
            for others, end in self._list(phrase.end + comma + last):
                self._text.count_step()
                # only "and" ends a list: what a comma adds may as well be a correction
                if len(others) < MAX_OBJECTS and (last or len(others) > 1):
                    yield (phrase, *others), end

    def _object(self, at: int) -> tuple[NounPhrase, ...]:
        """Return the phrases that name one object; in a clause that forbids something also those that name none."""
        found = self._phrases.at(at)
        if not self._forbidden:
            return found
        named = [phrase for phrase in found if phrase.name is not None]
        none = (each for each in self._phrases.unmatched if each.start == at and not each.candidates and not named)
        return (*named, *(NounPhrase(at, each.end, None, "name") for each in sorted(none)))


def _has_right_number(phrases: Sequence[NounPhrase]) -> bool:
    """Return whether each phrase names one object: the last one may share its plural noun with those before."""
    *others, last = phrases
    shares_noun = bool(others) and not any(phrase.with_noun for phrase in others)
    return not any(phrase.plural for phrase in others) and (not last.plural or shares_noun)
