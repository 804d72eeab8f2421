"""An uploaded instruction about one of several objects of one name -> the same with that object's number.

Where the hand went says which one was meant; words of place, decided by the scene, must say the same. What reads in two
ways is refused: a demonstration of the wrong object would teach it.
"""

from collections.abc import Iterator, Sequence

from app.pipeline.alike import Alike, gone_to
from app.pipeline.errors import UngroundedInstructionError
from app.pipeline.order import vocabulary
from app.pipeline.order.clauses import DIRECT, ParsedClause
from app.pipeline.order.lexicon import Lexicon
from app.pipeline.order.noun_phrases import NounPhrase, NounPhrases, TooInvolvedError
from app.pipeline.order.order import clause_texts
from app.pipeline.order.reading import FIELD, forbids
from app.pipeline.order.sentences import Sentences
from app.pipeline.order.space import Layout
from app.pipeline.order.taught import taught_verb
from app.pipeline.order.verbs import DESTINATIONS
from app.pipeline.order.words import IsWord
from roboprompt_client.arrays import Array

# What is done with a thing where it is, and what takes it somewhere: "press the button next to the plate" says which
# button, "put the bowl next to the plate" where to. "Push" and "take" may mean either.
STAYING = frozenset({
    "pick", "pick up", "grasp", "grab", "grip", "press", "tap", "hit", "click", "poke", "touch", "open", "close",
    "shut",
})  # fmt: skip
GOING = frozenset({"put", "put down", "place", "set", "set down", "lay", "lay down", "position", "stack", "insert"})
Reading = tuple[int, str, tuple[str, ...]]  # number of clauses, text, names in the order in which a hand goes to them


def with_numbers(instruction: str, layout: Layout, acts_m: Array, groups: Sequence[Alike], is_word: IsWord) -> str:
    """The instruction with each of several objects of one name by its number.

    Args:
        layout: of all objects of the scene, by their numbers.
        acts_m: (K, 3) where the hand closes, opens or is lowest.

    Raises:
        UngroundedInstructionError: if it may mean another one, or the hand goes to another.
    """
    names, called = tuple(layout.positions_m), " or ".join(group.called for group in groups)
    gone = [gone_to(group, layout.positions_m, acts_m) for group in groups]
    lexicon = Lexicon(names, {}, (), is_word)
    if not any(gone) and not _speaks_of(instruction, lexicon, groups):
        return instruction
    not_meant = {name for group, went in zip(groups, gone, strict=True) if len(went) == 1 for name in group.positions_m}
    by_hand = tuple(name for name in names if name not in not_meant.difference(*gone))
    read = {*_readings(instruction, lexicon, layout), *_readings(instruction, Lexicon(by_hand, {}, (), is_word), None)}
    found = [reading for reading in sorted(read) if reading[0] == min(read)[0]]
    valid = f"plain words that say by its place which {called} is meant"
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


def _listed(names: Sequence[str | None], group: Alike) -> str:
    return ", then ".join(name or "one that is not clear" for name in names) or f"no {group.called}"


def _speaks_of(instruction: str, lexicon: Lexicon, groups: Sequence[Alike]) -> bool:
    """Whether some word may stand for one of them."""
    alike = {name for group in groups for name in group.positions_m}
    texts = {word.text for word in lexicon.read(instruction)}
    return any(
        text in vocabulary.GENERIC_NOUNS or alike & (lexicon.objects_of.get(text, frozenset()) | lexicon.kind_of(text))
        for text in texts
    )


def _readings(instruction: str, lexicon: Lexicon, layout: Layout | None) -> Iterator[Reading]:
    """Every way in which each word has a place."""
    phrases = NounPhrases(instruction, lexicon, layout)
    if forbids(phrases.words):
        return
    verbs = frozenset(taught_verb(text, lexicon) for text in clause_texts(instruction)) - lexicon.objects_of.keys()
    try:
        for forms in Sentences(phrases, frozenset(), verbs).readings():
            clauses = forms[0]
            if all(map(_is_whole, clauses)):
                said = [phrase for clause in clauses for phrase in _in_order(clause)]
                named = dict.fromkeys(phrase.name for phrase in said if phrase.name)
                yield len(clauses), phrases.with_names(said), tuple(named)
    except TooInvolvedError:
        return


def _is_whole(clause: ParsedClause) -> bool:
    """Whether it says where something is put if, and only if, its verb needs that."""
    number = sum(role in DESTINATIONS for role, _ in clause.roles)
    return number == 1 if clause.verb in GOING else number == 0 if clause.verb in STAYING else number <= 1


def _in_order(clause: ParsedClause) -> list[NounPhrase]:
    """Its objects, what is acted on before where it goes."""
    direct = clause.objects_in(DIRECT)
    return [*direct, *(phrase for phrase in clause.phrases if phrase not in direct)]
