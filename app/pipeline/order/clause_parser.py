"""Parse the words of a text into clauses: a verb, objects in roles, and fixed words. Every parse is yielded."""

from collections.abc import Iterator
from dataclasses import replace

from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.clauses import DIRECT, INSTRUMENT, ParsedClause
from app.pipeline.order.coordination import Coordination
from app.pipeline.order.noun_phrases import NounPhrases
from app.pipeline.order.words import NUMBERS, PhraseTable, verb_forms

_NEVER_FIXED = frozenset(["and", "but", "or", "nor", "not", "never", "then", "it", "again", "use"])


class ClauseParser(Coordination):
    """The clauses of one instruction.

    Args:
        fixed: allowed words besides verb and objects; None: any (for taught instructions).
        taught_verbs: verbs of taught instructions that no table lists.
        of_steps: see `Coordination`.
    """

    def __init__(
        self,
        phrases: NounPhrases,
        fixed: frozenset[str] | None,
        taught_verbs: frozenset[str],
        *,
        of_steps: bool = False,
    ) -> None:
        super().__init__(phrases, of_steps=of_steps)
        self._fixed = fixed
        self._verbs = verbs.FIRST_WORDS | taught_verbs
        self._base_of = {form: verb for verb in taught_verbs for form in verb_forms(verb)} | verbs.FORMS

    def _skip(self, at: int, *tables: PhraseTable) -> int:
        """Return the end of the phrases of these tables that stand there, with a comma after each."""
        while self._end(at, vocabulary.RATHER) is None:
            ends = [end for table in tables if (end := self._end(at, table)) is not None]
            if not ends:
                break
            at = max(ends)
            if self._text(at) == "," and at + 1 < len(self._texts):
                at += 1
        return at

    def _forbids(self, at: int) -> bool:
        """Return whether words of negation or exception follow."""
        excepted = (vocabulary.EXCEPT,) if self._of_steps else ()
        return any(self._end(at, table) is not None for table in (vocabulary.RATHER, vocabulary.NOT, *excepted))

    def _separator(self, at: int) -> tuple[int, frozenset[str]]:
        """Return the end of the punctuation and conjunctions that stand there, and their kinds."""
        kinds: set[str] = set()
        while text := self._text(at):
            if (end := self._end(at, vocabulary.THEN)) is not None:
                kinds.add("then")
                at = end
            elif text in ("and", "but", ",", ".", ";") or (text == "?" and self._is_all_asked(at + 1)):
                kinds.add(text if text in ("and", "but", ",") else "stop")
                at += 1
            elif self._of_steps and text in vocabulary.ORDERING:
                kinds.add(text)
                at += 1
            else:
                break
        return at, frozenset(kinds)

    def _is_all_asked(self, at: int) -> bool:
        """Return whether nothing but punctuation and fillers ("thanks") follows."""
        while text := self._text(at):
            end = at + 1 if text in vocabulary.MARKS else self._end(at, vocabulary.FILLERS)
            if end is None:
                return False
            at = end
        return True

    def _clauses_at(self, at: int, *, forbidden: bool) -> Iterator[tuple[ParsedClause, int]]:
        """Yield every clause that begins there, and where it ends."""
        for verb, end in self._verb(at):
            yield from self._arguments(end, ParsedClause(verb), forbidden)
        yield from self._arguments(at, ParsedClause(None), forbidden)
        yield from self._passive(at, forbidden)
        yield from self._fronted(at, forbidden)

    def _passive(self, at: int, forbidden: bool) -> Iterator[tuple[ParsedClause, int]]:
        """Parse "the red button should be pushed"."""
        for phrases, end in self._objects(at, forbidden):
            if (begin := self._end(end, vocabulary.PASSIVE)) is not None:
                for verb, after in self._verb(begin, passive=True):
                    yield from self._arguments(after, ParsedClause(verb, ((DIRECT, phrases),)), forbidden)

    def _fronted(self, at: int, forbidden: bool) -> Iterator[tuple[ParsedClause, int]]:
        """Parse "on the plate, put the mug" and "use the cloth to wipe the table"."""
        used = self._text(at) == "use"
        role, start = (INSTRUMENT, at + 1) if used else self._preposition(at)
        for phrases, end in self._objects(start, forbidden) if role else ():
            introduced = self._text(end) == ("to" if used else ",")
            if used and not introduced:
                continue
            for verb, after in self._verb(self._skip(end + introduced, vocabulary.FILLERS)):
                yield from self._arguments(after, ParsedClause(verb, ((role, phrases),)), forbidden)

    def _verb(self, at: int, *, passive: bool = False) -> Iterator[tuple[str, int]]:
        """Yield the verbs at this word in the imperative, or as a passive participle; "pushed" alone is a report."""
        for phrase in verbs.TABLE.all_at(self._texts, at):
            if self._has_form(at, phrase[0], passive=passive):
                yield " ".join(phrase), at + len(phrase)
        text = self._text(at)
        base = text if text in self._verbs else self._base_of.get(text, "")  # "placed" is a word of places, too
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
        for more, end in self._with_next(start, clause, forbidden):
            yield from self._arguments(end, more, forbidden)
        if (clause.verb or clause.roles) and not clause.has_two_destinations and self._may_end(start):
            yield clause, start

    def _with_next(self, at: int, clause: ParsedClause, forbidden: bool) -> Iterator[tuple[ParsedClause, int]]:
        """Yield the clause with each argument that may begin at the word: phrases with objects, a particle, words."""
        role, start = self._preposition(at)
        for phrases, end in self._objects(start, forbidden) if role and not clause.objects_in(role) else ():
            yield clause.with_objects(role, phrases, after_article=False), end
        if not clause.objects_in(DIRECT):
            after_article = self._text(at) in vocabulary.DETERMINERS
            for phrases, end in self._objects(at, forbidden):
                yield clause.with_objects(DIRECT, phrases, after_article=after_article), end
        yield from self._with_possessor(at, clause, forbidden)
        if clause.objects_in(DIRECT) and (verb := f"{clause.verb} {self._text(at)}") in verbs.PHRASES:
            yield replace(clause, verb=verb), at + 1
        yield from self._with_fixed(at, clause)

    def _with_possessor(self, at: int, clause: ParsedClause, forbidden: bool) -> Iterator[tuple[ParsedClause, int]]:
        """Parse "the printer's button" as the button of the printer."""
        if "'s" not in self._texts[at:] or clause.objects_in("of"):
            return
        for phrases, end in self._objects(at, forbidden):
            if self._text(end) == "'s":
                yield from self._with_fixed(end + 1, clause.with_objects("of", phrases, after_article=False))

    def _with_fixed(self, at: int, clause: ParsedClause) -> Iterator[tuple[ParsedClause, int]]:
        """Yield the clause with a further fixed word, and the preposition and article before it."""
        role, start = self._preposition(at)
        if start == at + 1 and self._may_end(start):
            role, start = "", at  # an adverb: "screw the cap on"
        returns = self._text(start) in vocabulary.RETURNING and not clause.has_destination
        while self._text(start) in vocabulary.SOME:
            start += 1
        if not (word := self._fixed_word(start)):
            return
        if self._fixed is None or self._fixed.issuperset((f"{role}:", word) if role else (word,)):
            yield clause.with_fixed(role, word), start + 1
        elif returns and not role:
            apart = replace(clause, goes_on=False).with_fixed(role, word)
            yield replace(apart, goes_on=False), start + 1

    def _fixed_word(self, at: int) -> str:
        """Return the word as written, for "blocks" differs from "block"; "" for a word that may not be fixed."""
        word = self._words[at] if at < len(self._words) else None
        if word is None or word.text in _NEVER_FIXED or not word.text[0].isalnum():
            return ""
        return word.text if word.corrected or word.text in NUMBERS.values() else word.token.text

    def _may_end(self, at: int) -> bool:
        separated = self._text(at) in ("", "again") or self._separator(at)[0] > at
        first = self._end(at, vocabulary.FIRST) is not None
        return separated or first or self._forbids(at) or next(self._verb(at), None) is not None
