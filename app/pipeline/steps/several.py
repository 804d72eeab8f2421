"""Parts of a sentence about several clauses: their order, repetitions and exceptions."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

from app.pipeline.order.clauses import DIRECT, FixedPhrase, ParsedClause, without
from app.pipeline.order.descriptions import NounPhrase
from app.pipeline.order.sentences import Unit
from app.pipeline.order.verbs import PICKING
from app.pipeline.order.vocabulary import ORDERING, TIMES

IT = "taught"  # how the object of a pronoun was matched, see `NounPhrase.by`
TIMES_WORDS = frozenset(word for words in TIMES for word in words)


def as_pronoun(meant: Sequence[NounPhrase]) -> tuple[NounPhrase, ...]:
    """Return the objects as those of a pronoun."""
    return tuple(phrase._replace(by=IT) for phrase in meant)


def counted(clause: ParsedClause) -> tuple[ParsedClause, int]:
    """Return the clause without its count ("twice"), and the count."""
    *others, last = clause.fixed if clause.goes_on else (FixedPhrase("", ()),)
    for words, times in TIMES.items():
        if last.words[-len(words) :] == words:
            left = last.words[: -len(words)]
            kept = (*others, last._replace(words=left)) if left else tuple(others)
            return replace(clause, fixed=kept, goes_on=bool(left)), times
    return clause, 1


def is_akin(one: ParsedClause, other: ParsedClause) -> bool:
    """Return whether two clauses share a verb or an object, so that "twice" after the second may count for both."""
    shared = {phrase.name for phrase in one.phrases} & {phrase.name for phrase in other.phrases}
    return one.verb == other.verb or bool(shared)


def order_of(done: Sequence[Unit], units: Sequence[Unit]) -> Sequence[int]:
    """Return the indices of the units in the order in which they are done; empty if "before" or "after" is unclear."""
    in_text = range(len(done))
    ordered = [place for place, unit in enumerate(units) if unit.joined & ORDERING]
    if not ordered:
        return in_text
    joined = units[ordered[0]].joined
    if len(units) == 1 or len(done) < len(units) or len(ordered) > 1 or len(joined) > 1:
        return ()  # ", before" may belong to what comes next
    leads = ordered == [0] and units[1].joined == {","}
    if not leads and ordered != [len(units) - 1]:
        return ()
    if ("after" in joined) == leads:
        return in_text
    return in_text[::-1] if len(units) == 2 else ()


def without_excepted(units: Sequence[Unit]) -> tuple[Unit, ...]:
    """Return the units without exceptions ("all mugs except the red one"); none for an exception of another group."""
    kept: list[Unit] = []
    for unit in units:
        if unit.mood != "except":
            kept.append(unit)
            continue
        left = without(kept[-1].clause.objects_in(DIRECT) if kept else (), unit.clause.objects_in(DIRECT))
        if not left or unit.own_verb or len(unit.clause.roles) != 1:
            return ()
        kept[-1] = replace(kept[-1], clause=kept[-1].clause.with_role(DIRECT, left))
    return tuple(kept)


def is_unclear_what_is_forbidden(units: Sequence[Unit]) -> bool:
    """Return whether "do not press it, then open it" may forbid both, or "not twice" may ask for once."""
    counts = any(counted(unit.clause)[1] > 1 for unit in units if unit.mood != "do")
    return counts or any(one.mood == "not" and next_.joined & {"and", "then"} for one, next_ in pairwise(units))


def picked_up_to_put(units: Sequence[Unit], clauses: Sequence[ParsedClause]) -> Iterator[int]:
    """Yield the indices of the clauses that may be part of the next one.

    Demonstrations begin with an empty gripper: "pick up X and put it on Y" is "put X on Y", unless to pick it up is a
    task of its own. Then it may be meant as well, and is refused.
    """
    for place, (clause, after) in enumerate(zip(clauses, units[1:], strict=False)):
        puts_it = any(phrase.name is None for phrase in after.clause.objects_in(DIRECT)) and len(after.clause.roles) > 1
        says_no_more = [role for role, _ in clause.roles] == [DIRECT] and not clause.fixed_phrases
        if clause.verb in PICKING and says_no_more and puts_it:
            yield place
