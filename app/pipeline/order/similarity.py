"""How alike two tasks are by what is said of them: the words of their instructions and the names of their objects.

Colors, numbers and the closed classes of English say which object is meant, not what is done with it: they do not
count. The verb of a clause counts in its base form, and as any other of its family, so that to put is to place.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

from app.pipeline.order import verbs, vocabulary
from app.pipeline.order.order import clause_texts
from app.pipeline.order.vocabulary import FUNCTION_WORDS
from app.pipeline.order.words import NUMBERS, tokens_of

SIMILAR_TASKS = 3  # whose demonstrations are shown
_LEFT_OUT = FUNCTION_WORDS | vocabulary.COLORS.keys() | NUMBERS.keys()


@dataclass(frozen=True)
class Described:
    """A task as people speak of it.

    Attributes:
        instruction: one that it carries out.
        object_names: of its scene.
    """

    instruction: str
    object_names: tuple[str, ...]


def similarity(one: Described, other: Described) -> float:
    """From 0 to 2: the share of words that both instructions have, and that of the words of the objects' names."""
    said = _shared(_said(one.instruction), _said(other.instruction))
    return said + _shared(_named(one.object_names), _named(other.object_names))


def most_similar(
    asked: Described, tasks: Sequence[tuple[str, Described]], number: int = SIMILAR_TASKS
) -> tuple[str, ...]:
    """The names of at most `number` tasks, the most similar last.

    Of equally similar ones those with about as many objects count as more similar, then those that come first by name.
    Tasks with no word in common are taken only where no task has one.
    """
    related = [item for item in tasks if similarity(asked, item[1]) > 0]

    def unlikeness(item: tuple[str, Described]) -> tuple[float, int, str]:
        name, described = item
        return -similarity(asked, described), abs(len(described.object_names) - len(asked.object_names)), name

    return tuple(name for name, _ in sorted(related or tasks, key=unlikeness)[:number])[::-1]


def _shared(one: Collection[str], other: Collection[str]) -> float:
    """The Jaccard index; 0 where there are no words."""
    together = {*one, *other}
    return len(set(one) & set(other)) / len(together) if together else 0.0


@lru_cache(maxsize=1024)  # the stored tasks stay, and every question is compared with each of them
def _said(instruction: str) -> frozenset[str]:
    return frozenset(word for clause in clause_texts(instruction) for word in _said_in(clause))


def _said_in(clause: str) -> Iterator[str]:
    """The words of a clause that count; its verb is the first word that is one."""
    forms, has_verb = verbs.forms(), False
    for word in _words(clause):
        if not has_verb and word in forms:
            has_verb = True
            yield _of_family(forms[word])
        elif word not in _LEFT_OUT:
            yield word


def _of_family(verb: str) -> str:
    """One word for all verbs of the first family that has this one."""
    return next((min(family.verbs) for family in verbs.FAMILIES if verb in family.verbs), verb)


@lru_cache(maxsize=1024)
def _named(names: tuple[str, ...]) -> frozenset[str]:
    return frozenset(word for name in names for word in _words(name) if word not in _LEFT_OUT)


def _words(text: str) -> list[str]:
    return [token.text for token in tokens_of(text.replace("_", " ")) if token.text[0].isalpha()]
