"""Sentences: what is to be done with which objects, clause by clause; what is forbidden is left out.

Everything in an instruction must find its place here. Where a word does not, there is no reading, and the instruction
is refused: an unknown word may change what the others mean.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from app.pipeline.language import grammar, verbs
from app.pipeline.language.phrases import NounPhrase, NounPhrases
from app.pipeline.language.tables import PhraseTable
from app.pipeline.language.words import NUMBERS, Word

DIRECT = ""  # the role of a direct object; the others are named after prepositions
MAX_OBJECTS = 8  # of one role
Mood = Literal["do", "not", "skip", "rather"]
_PICKING = frozenset(
    {"pick", "pick up", "grasp", "grab", "grip", "take", "lift", "lift up", "get", "take hold of", "grab hold of"}
)
_NEVER_FIXED = frozenset(["and", "but", "or", "nor", "not", "never", "then", "it"])


@dataclass(frozen=True)
class Clause:
    """One thing to do.

    Attributes:
        verb: in its base form, with its particle; None where a noun phrase stands alone.
        roles: by preposition (see `grammar.PREPOSITIONS`) or `DIRECT` the objects, in their order.
        fixed: words of taught instructions that are no objects, as "the dirt" in "sweep the dirt to the dustpan".
    """

    verb: str | None
    roles: tuple[tuple[str, tuple[NounPhrase, ...]], ...] = ()
    fixed: tuple[str, ...] = ()

    def objects_in(self, role: str) -> tuple[NounPhrase, ...]:
        """Those of a role; none if it is not filled."""
        return dict(self.roles).get(role, ())

    @property
    def phrases(self) -> tuple[NounPhrase, ...]:
        """All of its objects."""
        return tuple(phrase for _, phrases in self.roles for phrase in phrases)

    def about(self, phrase: NounPhrase) -> "Clause":
        """With a direct object instead of "it" or none."""
        others = tuple((role, phrases) for role, phrases in self.roles if role != DIRECT)
        return replace(self, roles=((DIRECT, (phrase,)), *others))


@dataclass(frozen=True)
class _Unit:
    clause: Clause
    mood: Mood


class Sentences:
    """The readings of one instruction.

    Args:
        fixed: words that a clause may have besides verb and objects; None: any (for taught instructions).
        taught_verbs: verbs of taught instructions that no table has.
    """

    def __init__(
        self, words: Sequence[Word], phrases: NounPhrases, fixed: frozenset[str] | None, taught_verbs: frozenset[str]
    ) -> None:
        self._words = words
        self._texts = [word.text for word in words]
        self._phrases = phrases
        self._fixed = fixed
        self._verbs = verbs.FIRST_WORDS | taught_verbs

    def readings(self) -> Iterator[tuple[tuple[Clause, ...], ...]]:
        """The things to do, in their order, in every way that the whole text can be read.

        Where one way has several forms, of which the first that was taught is meant, these stand together.

        Raises:
            TooInvolvedError: if that takes too many steps.
        """
        for units in self._units(0, (), frozenset()):
            done = tuple(unit.clause for unit in units if unit.mood == "do")
            forbidden = [unit.clause for unit in units if unit.mood != "do"]
            says_what = len(units) == 1 or all(unit.clause.roles for unit in units)
            if done and says_what and not any(_contradict(one, other) for one in forbidden for other in done):
                yield _without_pronouns(done)

    def _at_end(self, at: int) -> bool:
        return at >= len(self._words)

    def _text(self, at: int) -> str:
        return "" if self._at_end(at) else self._texts[at]

    def _end(self, at: int, table: PhraseTable) -> int | None:
        return table.end_at(self._texts, at)

    def _skip(self, at: int, *tables: PhraseTable) -> int:
        """Where what says nothing ends."""
        while self._end(at, grammar.RATHER) is None:
            ends = [end for table in tables if (end := self._end(at, table)) is not None]
            if not ends:
                break
            at = max(ends)
            if self._text(at) == "," and not self._at_end(at + 1):
                at += 1
        return at

    def _units(self, at: int, units: tuple[_Unit, ...], joined: frozenset[str]) -> Iterator[tuple[_Unit, ...]]:
        """The text from here on.

        Args:
            joined: by what the unit that begins here is joined to the one before.
        """
        self._phrases.count_step()
        start = self._skip(at, grammar.FILLERS, grammar.LEADS, *self._leads_after(units))
        if units and all(self._text(k) in ".?," for k in range(start, len(self._words))):
            yield units
            return
        forbidding: tuple[tuple[Mood, PhraseTable], ...] = (
            ("not", grammar.NOT), ("skip", grammar.SKIP), ("rather", grammar.RATHER),
        )  # fmt: skip
        for mood, table in forbidding:
            if (end := self._end(start, table)) is not None:
                for clause, after in self._clauses(end, forbidden=True):
                    yield from self._after(after, (*units, _Unit(_inherited(clause, units), mood)))
        for begin in {at, start}:
            for clause, after in self._clauses(begin, forbidden=False):
                if _may_follow(clause, units, joined):
                    yield from self._after(after, (*units, _Unit(_inherited(clause, units), "do")))

    def _leads_after(self, units: tuple[_Unit, ...]) -> tuple[PhraseTable, ...]:
        """A later "first" would change the order, and an "instead" after what was wanted takes that back."""
        if not units:
            return (grammar.FIRST, grammar.INSTEAD)
        return () if any(unit.mood == "do" for unit in units) else (grammar.INSTEAD,)

    def _after(self, at: int, units: tuple[_Unit, ...]) -> Iterator[tuple[_Unit, ...]]:
        """What follows a unit: the end, a separator, or what is not meant."""
        if len(units) == 1 and (first := self._end(at, grammar.FIRST)) is not None and self._separator(first)[1]:
            at = first  # "push the red button first, then the blue one"
        end, joined = self._separator(at)
        if self._at_end(end):
            yield units
        elif end > at or units[-1].mood == "rather" or self._forbids(at):
            yield from self._units(end, units, joined)

    def _forbids(self, at: int) -> bool:
        return any(self._end(at, table) is not None for table in (grammar.RATHER, grammar.NOT))

    def _separator(self, at: int) -> tuple[int, frozenset[str]]:
        """Where the marks and conjunctions end that stand here, and of which sorts they are."""
        sorts: set[str] = set()
        while not self._at_end(at):
            text = self._text(at)
            if (end := self._end(at, grammar.THEN)) is not None:
                sorts.add("then")
                at = end
            elif text in ("and", "but", ",", ".", ";", "?"):
                sorts.add(text if text in ("and", "but", ",") else "stop")
                at += 1
            else:
                break
        return at, frozenset(sorts)

    def _clauses(self, at: int, *, forbidden: bool) -> Iterator[tuple[Clause, int]]:
        """The clauses that begin here, and where each ends."""
        for verb, end in self._verb(at):
            yield from self._arguments(end, Clause(verb), forbidden)
        yield from self._arguments(at, Clause(None), forbidden)
        yield from self._passive(at, forbidden)
        role, start = self._preposition(at)
        for phrases, end in self._objects(start, forbidden) if role else ():
            begin = end + 1 if self._text(end) == "," else end
            for verb, after in self._verb(self._skip(begin, grammar.FILLERS)):
                yield from self._arguments(after, Clause(verb, ((role, phrases),)), forbidden)

    def _passive(self, at: int, forbidden: bool) -> Iterator[tuple[Clause, int]]:
        """The red button should be pushed."""
        for phrases, end in self._objects(at, forbidden):
            if (begin := self._end(end, grammar.PASSIVE)) is not None:
                for verb, after in self._verb(begin):
                    yield from self._arguments(after, Clause(verb, ((DIRECT, phrases),)), forbidden)

    def _verb(self, at: int) -> Iterator[tuple[str, int]]:
        for phrase in verbs.TABLE.all_at(self._texts, at):
            yield " ".join(phrase), at + len(phrase)
        text = self._text(at)
        base = text if text in self._verbs else verbs.forms().get(text, "")  # "placed" is a word of places, too
        if base and (base != text or base not in verbs.PHRASES):
            yield base, at + 1

    def _arguments(self, at: int, clause: Clause, forbidden: bool) -> Iterator[tuple[Clause, int]]:
        """With everything that may follow the verb, wherever the clause may end."""
        self._phrases.count_step()
        start = self._skip(at, grammar.FILLERS)
        role, after = self._preposition(start)
        for phrases, end in self._objects(after, forbidden) if role else ():
            if not clause.objects_in(role):
                yield from self._arguments(end, replace(clause, roles=(*clause.roles, (role, phrases))), forbidden)
        if not clause.objects_in(DIRECT):
            for phrases, end in self._objects(start, forbidden):
                yield from self._arguments(end, replace(clause, roles=(*clause.roles, (DIRECT, phrases))), forbidden)
        if f"{clause.verb} {self._text(start)}" in verbs.PHRASES:
            verb = f"{clause.verb} {self._text(start)}"
            yield from self._arguments(start + 1, replace(clause, verb=verb), forbidden)
        yield from self._with_fixed(start, clause, forbidden)
        if (clause.verb or clause.roles) and self._may_end(start):
            yield clause, start

    def _with_fixed(self, at: int, clause: Clause, forbidden: bool) -> Iterator[tuple[Clause, int]]:
        """With a word that is no object, and the preposition and article before it."""
        role, start = self._preposition(at)
        while self._text(start) in grammar.DETERMINERS:
            start += 1
        if self._at_end(start):
            return
        word = self._fixed_word(start)
        wanted = (*((f"{role}:",) if role else ()), word)
        if word and (self._fixed is None or self._fixed.issuperset(wanted)):
            yield from self._arguments(start + 1, replace(clause, fixed=(*clause.fixed, *wanted)), forbidden)

    def _fixed_word(self, at: int) -> str:
        """The word as clauses keep it: in the form in which it stands, for "blocks" are more than a block."""
        word = self._words[at]
        if word.text in _NEVER_FIXED or not word.text[0].isalnum():
            return ""
        return word.text if word.corrected or word.text in NUMBERS.values() else word.token.text

    def _may_end(self, at: int) -> bool:
        separated = self._at_end(at) or self._separator(at)[0] > at or self._end(at, grammar.FIRST) is not None
        return separated or self._forbids(at) or next(self._verb(at), None) is not None

    def _preposition(self, at: int) -> tuple[str, int]:
        end = self._end(at, grammar.PREPOSITIONS)
        if end is None:
            return "", at
        return grammar.ROLES[tuple(self._texts[at:end])], end

    def _objects(self, at: int, forbidden: bool) -> Iterator[tuple[tuple[NounPhrase, ...], int]]:
        """One object or several: "the red, the blue and the green button"."""
        both = self._text(at) == "both"
        for phrases, end in self._listed(at + both, forbidden):
            singular = all(not phrase.plural for phrase in phrases[:-1])
            right_number = singular and (len(phrases) > 1 or not phrases[-1].plural) and not self._is_one_thing(phrases)
            if (right_number or forbidden) and (not both or len(phrases) == 2):
                yield phrases, end

    def _is_one_thing(self, phrases: Sequence[NounPhrase]) -> bool:
        """Whether a list may describe a single object: "the red and green button" may have two colours."""
        first, last = phrases[0], phrases[-1]
        with_article = self._text(first.start) in grammar.DETERMINERS, self._text(last.start) in grammar.DETERMINERS
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
        """What stands for one object; in a clause that forbids something also what stands for none."""
        found = self._phrases.at(at)
        if not forbidden:
            return found
        none = (miss for miss in self._phrases.misses if miss.start == at and not miss.candidates)
        named = (phrase for phrase in found if phrase.name is not None)
        return (*named, *(NounPhrase(at, miss.end, None, "name") for miss in sorted(none)))


def _contradict(forbidden: Clause, wanted: Clause) -> bool:
    """Whether what is wanted has the objects that are forbidden, in the same roles."""
    names = {role: {phrase.name for phrase in phrases} for role, phrases in wanted.roles}
    return all({p.name for p in phrases} & names.get(role, set()) for role, phrases in forbidden.roles)


def _inherited(clause: Clause, units: Sequence[_Unit]) -> Clause:
    """With the verb of the unit before where it has none."""
    before = next((unit.clause.verb for unit in reversed(units) if unit.clause.verb), None)
    return clause if clause.verb else replace(clause, verb=before)


def _may_follow(clause: Clause, units: Sequence[_Unit], joined: frozenset[str]) -> bool:
    """Whether a clause goes on with what is wanted.

    "Do not push the red one and the blue one" wants nothing, and "push the red one, the blue one" is perhaps a
    correction; "not the red one, the blue one" is none.
    """
    before = units[-1] if units else None
    if before is None:
        return True
    if before.mood in ("do", "rather"):
        fronted = before.mood == "rather" and len(units) == 1
        return clause.verb is not None or fronted or bool(joined & {"and", "then"})
    if before.mood == "skip":
        return clause.verb is not None
    if "but" in joined or clause.verb:
        return not joined.isdisjoint({"but", ",", "stop"})
    return "," in joined and len(units) == 1 and before.clause.verb is None


def _without_pronouns(clauses: tuple[Clause, ...]) -> tuple[tuple[Clause, ...], ...]:
    """The clauses with "it" replaced; first of all "pick up X and put it on Y" as the single clause "put X on Y".

    Demonstrations begin with an empty gripper: one that puts something somewhere picks it up by itself.
    """
    resolved: list[Clause] = []
    merged: list[Clause] = []
    for clause in clauses:
        direct = clause.objects_in(DIRECT)
        antecedent = resolved[-1].objects_in(DIRECT) if resolved else ()
        if (direct and direct[0].name) or not clause.verb or len(antecedent) != 1 or not antecedent[0].name:
            resolved.append(clause)
            merged.append(clause)
            continue
        whole = clause.about(antecedent[0])
        picked = merged[-1].verb in _PICKING and len(merged[-1].roles) == 1
        merged = [*merged[:-1], whole] if picked else [*merged, whole]
        resolved.append(whole)
    return (tuple(merged), tuple(resolved)) if len(merged) < len(resolved) else (tuple(resolved),)
