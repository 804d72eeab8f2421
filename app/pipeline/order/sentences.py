"""Sentences: the clauses to carry out, in their order; what is forbidden is left out.

    sentence  = ["before" | "after"] unit {separator unit | forbidden} [separator]
    unit      = {lead} (clause | forbidden)
    forbidden = ("do not" | "skip" | "instead of" | "except") clause
    separator = {"," | ";" | "." | "and" | "but" | "then" | "before" | "after"}
    lead      = "please" | "could you" | "first" | ...

"Before", "after" and "except" only where a sentence may ask for several steps. Every word must have a role: an unknown
one may change the meaning of the others, so that there is no parse.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise
from typing import Literal

from app.pipeline.order import vocabulary
from app.pipeline.order.clause_parser import Accepted, ClauseParser
from app.pipeline.order.clauses import DIRECT, INSTRUMENT, SOURCE, ParsedClause
from app.pipeline.order.noun_phrases import NounPhrases
from app.pipeline.order.verbs import CONTAINING, PICKING
from app.pipeline.order.vocabulary import PhraseTable

Mood = Literal["do", "not", "skip", "rather", "except"]
FORBIDDING: dict[Mood, PhraseTable[None]] = {
    "not": vocabulary.NOT, "skip": vocabulary.SKIP, "rather": vocabulary.RATHER, "except": vocabulary.EXCEPT,
}  # fmt: skip


@dataclass(frozen=True)
class Unit:
    """A clause of a text, and whether it asks for or forbids something.

    Attributes:
        clause: with the verb of the one before where it has none of its own.
        mood: "do", or the kind of words that forbid it.
        joined: the kinds of words between it and the unit before, see `ClauseParser.separator`.
        start, end: the range of its words.
    """

    clause: ParsedClause
    mood: Mood
    own_verb: bool
    joined: frozenset[str]
    start: int
    end: int


class Sentences:
    """The parses of one instruction."""

    def __init__(self, phrases: NounPhrases, accepted: Accepted) -> None:
        self._text = phrases.text
        self._clauses = ClauseParser(phrases, accepted)
        self._forbidden = ClauseParser(phrases, accepted, forbidden=True)
        self._of_steps = accepted.of_steps

    def units(self) -> Iterator[tuple[Unit, ...]]:
        """Yield every parse of the whole text that is an order.

        Raises:
            TooInvolvedError: if parsing takes too many steps.
        """
        return filter(self._is_order, self._units(0, (), frozenset()))

    def readings(self) -> Iterator[tuple[tuple[ParsedClause, ...], ...]]:
        """Yield the forms of every parse of the whole text, see `forms_of`; the first that was taught counts.

        Raises:
            TooInvolvedError: if parsing takes too many steps.
        """
        return filter(None, map(forms_of, self.units()))

    def _is_order(self, units: Sequence[Unit]) -> bool:
        if not _lists_end_with_and(units):
            return False
        if any(unit.own_verb for unit in units):
            return True
        phrases = units[0].clause.phrases
        named = all(phrase.name for phrase in phrases) and any(phrase.with_noun for phrase in phrases)
        return len(units) > 1 or named

    def _units(self, at: int, units: tuple[Unit, ...], joined: frozenset[str]) -> Iterator[tuple[Unit, ...]]:
        """Yield every parse of the text from word `at` on.

        Args:
            joined: the kinds of words between the unit that begins here and the one before.
        """
        self._text.count_step()
        start = self._clauses.skip(at, vocabulary.FILLERS, vocabulary.LEADS, *self._leads_after(units, joined))
        if self._of_steps and not units and not joined and self._text.at(start) in vocabulary.ORDERING:
            yield from self._units(start + 1, units, frozenset({self._text.at(start)}))
        goes_on = joined & {"then", "but", *vocabulary.ORDERING}  # "turn it left, then right now"
        if units and not goes_on and all(text in ".," for text in self._text.texts[start:]):
            yield units
            return
        wanted = [self._wanted(begin, units, joined) for begin in sorted({at, start})]
        for unit in chain(self._forbidding(start, units, joined), *wanted):
            yield from self._after(unit.end, (*units, unit))

    def _forbidding(self, at: int, units: tuple[Unit, ...], joined: frozenset[str]) -> Iterator[Unit]:
        for mood, table in FORBIDDING.items():
            if (self._of_steps or mood != "except") and (end := self._text.end(at, table)) is not None:
                for clause, after in self._forbidden.at(end):
                    yield _unit(clause, units, mood, joined, at, after)

    def _wanted(self, at: int, units: tuple[Unit, ...], joined: frozenset[str]) -> Iterator[Unit]:
        for clause, after in self._clauses.at(at):
            if _may_follow(clause, units, joined) and not self._describes(clause, units, joined):
                yield _unit(clause, units, "do", joined, at, after)

    def _describes(self, clause: ParsedClause, units: Sequence[Unit], joined: frozenset[str]) -> bool:
        """Return whether a clause without a verb may be a further description of the object before it."""
        before = units[-1].clause.phrases[-1:] if units else ()
        if clause.verb is not None or "then" in joined or not before:
            return False
        return self._clauses.is_one_thing((*before, *clause.phrases[:1]))

    def _leads_after(self, units: tuple[Unit, ...], joined: frozenset[str]) -> tuple[PhraseTable[None], ...]:
        """Return the words that may begin the next unit.

        A later "first" would change the sequence, and "instead" after a wanted clause would take it back.
        """
        if joined & vocabulary.ORDERING:
            return (vocabulary.YOU,)
        if not units:
            return (vocabulary.FIRST, vocabulary.INSTEAD)
        return () if any(unit.mood == "do" for unit in units) else (vocabulary.INSTEAD,)

    def _after(self, at: int, units: tuple[Unit, ...]) -> Iterator[tuple[Unit, ...]]:
        """Yield every parse of what follows a unit: the end, a separator, or a forbidden clause."""
        first = self._text.end(at, vocabulary.FIRST)
        if len(units) == 1 and units[0].mood == "do" and first is not None and self._clauses.separator(first)[1]:
            at = first  # "push the red button first, then the blue one"
        if self._of_steps and len(units) > 1 and self._text.at(at) == "again":
            at += 1  # "open the box, put it in and close the box again"
        end, joined = self._clauses.separator(at)
        if not self._text.at(end):
            if joined <= {",", "stop"}:  # "now and then" and "after that" say when
                yield units
        elif end > at or units[-1].mood == "rather" or self._clauses.forbids(at):
            yield from self._units(end, units, joined)


def _lists_end_with_and(units: Sequence[Unit]) -> bool:
    """Return whether each clause that a comma alone adds without a verb is followed by one that "and" adds.

    "Put the cup on the tray, the plate on the shelf" may be a correction.
    """
    open_ended = False
    for before, unit in pairwise(units):
        if open_ended and unit.own_verb:
            return False
        open_ended = before.mood == unit.mood == "do" and not unit.own_verb and unit.joined == {","}
    return not open_ended


def wanted(units: Sequence[Unit]) -> tuple[Unit, ...]:
    """Return the units to carry out; empty where what is forbidden leaves the order unclear, see `_is_other`."""
    done = tuple(unit for unit in units if unit.mood == "do")
    clauses = [unit.clause for unit in done]
    says_what = len(units) == 1 or all(unit.clause.roles for unit in units)
    is_clear = says_what and all(_is_other(unit.clause, clauses) for unit in units if unit.mood != "do")
    return done if is_clear else ()


def _is_other(forbidden: ParsedClause, wanted: Sequence[ParsedClause]) -> bool:
    """Return whether the forbidden clause is an alternative to the wanted ones.

    It is none if it contradicts a wanted clause, nor if it forbids another kind of motion: "do not touch the blue one"
    would restrict the path to the red one, which this parser cannot express. "Wipe it, not with the cloth" leaves open
    what to wipe it with.
    """
    similar = [clause for clause in wanted if _same_verb(forbidden, clause)]
    omitted = {role for role in (INSTRUMENT, SOURCE) if forbidden.objects_in(role)}
    leaves_open = any(not clause.objects_in(role) for clause in similar for role in omitted)
    return bool(similar) and not leaves_open and not any(_contradict(forbidden, clause) for clause in wanted)


def _same_verb(forbidden: ParsedClause, wanted: ParsedClause) -> bool:
    same = not forbidden.verb or not wanted.verb or forbidden.verb == wanted.verb
    return same or bool(wanted.families_with(forbidden.verb))


def _contradict(forbidden: ParsedClause, wanted: ParsedClause) -> bool:
    names = {role: {phrase.name for phrase in phrases} for role, phrases in wanted.roles}
    return all({p.name for p in phrases} & names.get(role, set()) for role, phrases in forbidden.roles)


def _unit(
    clause: ParsedClause, units: Sequence[Unit], mood: Mood, joined: frozenset[str], start: int, end: int
) -> Unit:
    before = next((unit.clause.verb for unit in reversed(units) if unit.clause.verb), None)
    with_verb = clause if clause.verb else replace(clause, verb=before)
    return Unit(with_verb, mood, clause.verb is not None, joined, start, end)


def _may_follow(clause: ParsedClause, units: Sequence[Unit], joined: frozenset[str]) -> bool:
    """Return whether a clause can be a further wanted one after these units.

    "Do not push the red one and the blue one" asks for nothing, and "push the red one, the blue one" may be a
    correction; "not the red one, the blue one" is unambiguous.
    """
    before = units[-1] if units else None
    if before is None:
        return True
    if before.mood in ("do", "rather"):
        fronted = before.mood == "rather" and len(units) == 1
        listed = joined == {","} and len(clause.roles) > 1  # a correction unless "and" follows, see `_is_order`
        return clause.verb is not None or fronted or listed or bool(joined & {"and", "then", *vocabulary.ORDERING})
    if before.mood in ("skip", "except"):
        return clause.verb is not None
    if "but" in joined or clause.verb:
        return not joined.isdisjoint({"but", ",", "stop"})
    return "," in joined and len(units) == 1 and before.clause.verb is None


def forms_of(units: Sequence[Unit]) -> tuple[tuple[ParsedClause, ...], ...]:
    """Return the clauses to carry out in equivalent forms, the preferred one first; none where the order is unclear.

    "It" is resolved. "Pick up X and put it on Y" is "put X on Y" at first: demonstrations begin with an empty gripper,
    so that putting an object somewhere includes picking it up.
    """
    clauses = [unit.clause for unit in wanted(units)]
    if not clauses:
        return ()
    resolved: list[ParsedClause] = []
    merged: list[ParsedClause] = []
    for clause in clauses:
        whole = _without_pronoun(clause, resolved[-1]) if resolved else clause
        if whole is clause:
            resolved.append(clause)
            merged.append(clause)
            continue
        same = whole.objects_in(DIRECT) == resolved[-1].objects_in(DIRECT)
        picked = same and merged[-1].verb in PICKING and len(merged[-1].roles) == 1
        announced = same and resolved[-1].names_a_thing  # "the red button, push it"
        merged = [*merged[:-1], whole] if picked or announced else [*merged, whole]
        resolved = [*resolved[:-1], whole] if announced else [*resolved, whole]
    return (tuple(merged), tuple(resolved)) if len(merged) < len(resolved) else (tuple(resolved),)


def _without_pronoun(clause: ParsedClause, before: ParsedClause) -> ParsedClause:
    """Return the clause with the object that "it" stands for; itself without a pronoun, or where that is not clear.

    "It" is what the clause before acts on. After "put the mug in the drawer" one closes the drawer, after "turn on the
    stove" a pot is put on the stove, and after "put the soup in the box" the sauce is put in the box.
    """
    if not clause.verb:
        return clause
    direct = clause.objects_in(DIRECT)
    if direct and direct[0].name:
        at = next((role for role, phrases in clause.roles if any(each.name is None for each in phrases)), None)
        if at is None:
            return clause
        meant = before.phrases if len(before.roles) == 1 else before.objects_in(at)
    else:
        at, container = DIRECT, before.objects_in("in") if clause.verb in CONTAINING else ()
        meant = container or before.objects_in(DIRECT)
    return clause.with_role(at, meant) if len(meant) == 1 and meant[0].name else clause
