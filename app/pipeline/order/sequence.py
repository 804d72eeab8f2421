"""Clauses that an earlier clause makes impossible. The objects' places are known only before the first action."""

from collections.abc import Sequence
from itertools import combinations, pairwise

from app.pipeline.order.clauses import DIRECT, ParsedClause


def uses_moved_object(clauses: Sequence[ParsedClause]) -> bool:
    """Return whether a clause uses an object that an earlier one moved, or moves one that something was put on.

    A covered object cannot be grasped as it was taught. Picking the same object up twice in a row is allowed.
    """
    moved: set[str | None] = set()
    covered: set[str | None] = set()
    for before, clause in pairwise((None, *clauses)):
        assert clause is not None
        direct = _names(clause, DIRECT)
        again = before is not None and before.picks_up and clause.picks_up and direct == _names(before, DIRECT)
        if not again and not moved.isdisjoint(phrase.name for phrase in clause.phrases):
            return True
        if clause.picks_up or clause.takes_somewhere:
            if not covered.isdisjoint(direct):
                return True
            moved |= direct
            covered |= _names(clause, "on")
    return False


def needs_full_hand(clauses: Sequence[ParsedClause]) -> bool:
    """Return whether a clause is about other objects than the one that the hand holds, or picks up another one."""
    held: set[str | None] = set()
    for clause in clauses:
        direct = _names(clause, DIRECT)
        elsewhere = bool(held) and held.isdisjoint(phrase.name for phrase in clause.phrases)
        if elsewhere or (clause.picks_up and len(held | direct) > 1):
            return True
        if clause.picks_up or clause.takes_somewhere:
            held = direct if clause.picks_up else set()
    return False


def is_placed_after_moving(clauses: Sequence[ParsedClause]) -> bool:
    """Return whether a clause identifies an object by its place after something was moved."""
    return any(
        any(phrase.by == "relation" for phrase in later.phrases) and (earlier.picks_up or earlier.takes_somewhere)
        for earlier, later in combinations(clauses, 2)
    )


def _names(clause: ParsedClause, role: str) -> set[str | None]:
    return {phrase.name for phrase in clause.objects_in(role)} - {None}
