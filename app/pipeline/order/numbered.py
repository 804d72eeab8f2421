"""An uploaded instruction -> the same with the numbers of objects of one name.

The object that is meant is the one that the hand goes to, and words of place must agree. An instruction with two
meanings is refused: a demonstration of the wrong object would teach it.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from app.pipeline.alike import PLACE_EXAMPLE, Alike
from app.pipeline.errors import UngroundedInstructionError
from app.pipeline.order import vocabulary
from app.pipeline.order.clause_parser import Accepted
from app.pipeline.order.clauses import DIRECT, ParsedClause
from app.pipeline.order.descriptions import NounPhrase
from app.pipeline.order.frames import taught_verbs
from app.pipeline.order.lexicon import Lexicon, TooInvolvedError
from app.pipeline.order.noun_phrases import NounPhrases
from app.pipeline.order.order import FIELD, Order
from app.pipeline.order.sentences import Sentences
from app.pipeline.order.space import Layout
from app.pipeline.order.verbs import GOING, STAYING
from app.pipeline.order.vocabulary import DESTINATIONS
from roboprompt_client.types.arrays import Array

GOES_TO_M = 0.2  # a hand that closes, opens or is lowest within this of an object's origin may act on it,
CLEARLY = 2.0  # if all others of its name are so many times as far
Reading = tuple[int, str, tuple[str, ...]]  # number of clauses, text, names in the order in which a hand goes to them


def with_numbers(instruction: str, layout: Layout, acts_m: Array, groups: Sequence[Alike]) -> str:
    """Return an uploaded instruction with the numbers of objects of one name.

    Args:
        layout: of all objects of the scene, by their numbers.
        acts_m: (K, 3) where the hand closes, opens or is lowest.

    Raises:
        UngroundedInstructionError: if it may mean another object, or the hand goes to another.
    """
    names, called = tuple(layout.positions_m), " or ".join(group.called for group in groups)
    gone = [gone_to(group, layout.positions_m, acts_m) for group in groups]
    lexicon = Lexicon(names, {}, ())
    if not any(gone) and not _speaks_of(instruction, lexicon, groups):
        return instruction
    not_meant = {name for group, went in zip(groups, gone, strict=True) if len(went) == 1 for name in group.positions_m}
    by_hand = tuple(name for name in names if name not in not_meant.difference(*gone))
    read = {*_readings(instruction, lexicon, layout), *_readings(instruction, Lexicon(by_hand, {}, ()), None)}
    found = [reading for reading in sorted(read) if reading[0] == min(read)[0]]
    valid = f"words of place that say which {called} is meant: {PLACE_EXAMPLE}"
    if len(found) != 1:
        either = " or ".join(repr(text) for _, text, _ in found[:3])
        message = f"may mean {either}" if found else f"does not say clearly which {called} is meant"
        raise UngroundedInstructionError(FIELD, f"{instruction!r} {message}", valid)
    _, text, named = found[0]
    for group, went in zip(groups, gone, strict=True):
        said = tuple(name for name in named if name in group.positions_m)
        if said != went:
            means, goes = _listed(said, group), _listed(went, group)
            message = f"{instruction!r} means {means}, but the hand goes to {goes}"
            raise UngroundedInstructionError(FIELD, message, valid)
    return text


def gone_to(alike: Alike, positions_m: Mapping[str, Array], acts_m: Array) -> tuple[str | None, ...]:
    """Return the objects of the group that a hand goes to, in its order; None for one that is not clear.

    Args:
        positions_m: (3,) of all objects of the scene.
        acts_m: (K, 3) where the hand closes, opens or is lowest.
    """
    found: dict[str | None, None] = {}
    names, places_m = list(alike.positions_m), np.array(list(alike.positions_m.values()))
    others_m = [place_m for name, place_m in positions_m.items() if name not in alike.positions_m]
    for act_m in acts_m:
        off_m = np.linalg.norm(places_m - act_m, axis=1)
        nearest, second = np.argsort(off_m)[:2]
        other_m = min((float(np.linalg.norm(place_m - act_m)) for place_m in others_m), default=np.inf)
        if off_m[nearest] <= min(GOES_TO_M, other_m):
            found[names[nearest] if off_m[second] >= CLEARLY * off_m[nearest] else None] = None
    return tuple(found)


def _listed(names: Sequence[str | None], group: Alike) -> str:
    return ", then ".join(name or "one that is not clear" for name in names) or f"no {group.called}"


def _speaks_of(instruction: str, lexicon: Lexicon, groups: Sequence[Alike]) -> bool:
    """Return whether a word may name an object of the groups."""
    alike = {name for group in groups for name in group.positions_m}
    texts = {word.text for word in lexicon.read(instruction)}
    return any(
        text in vocabulary.GENERIC_NOUNS or alike & (lexicon.objects_of.get(text, frozenset()) | lexicon.kind_of(text))
        for text in texts
    )


def _readings(instruction: str, lexicon: Lexicon, layout: Layout | None) -> Iterator[Reading]:
    phrases = NounPhrases(instruction, lexicon, layout)
    if phrases.text.forbids:
        return
    texts = [clause.text for clause in Order(instruction, lexicon.names).clauses]
    accepted = Accepted(taught_verbs(texts, lexicon))
    try:
        for forms in Sentences(phrases, accepted).readings():
            clauses = forms[0]
            if all(map(_is_whole, clauses)):
                said = [phrase for clause in clauses for phrase in _in_order(clause)]
                named = dict.fromkeys(phrase.name for phrase in said if phrase.name)
                yield len(clauses), phrases.with_names(said), tuple(named)
    except TooInvolvedError:
        return


def _is_whole(clause: ParsedClause) -> bool:
    """Return whether the clause has a destination exactly if its verb needs one."""
    number = sum(role in DESTINATIONS for role, _ in clause.roles)
    return number == 1 if clause.verb in GOING else number == 0 if clause.verb in STAYING else number <= 1


def _in_order(clause: ParsedClause) -> list[NounPhrase]:
    """Return the objects of a clause, the direct ones first."""
    direct = clause.objects_in(DIRECT)
    return [*direct, *(phrase for phrase in clause.phrases if phrase not in direct)]
