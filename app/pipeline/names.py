"""Names of objects and their aliases: when two spellings are one name, and which names and aliases are refused.

Instructions, prompts, settings and the store must all mean the same object by a name.
"""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence

from app.pipeline.errors import ObjectSetError
from app.pipeline.order import vocabulary
from app.pipeline.order.forms import plurals_of, singulars_of
from app.pipeline.order.words import folded_characters, phrase_of
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.names import checked_object_name

_SEPARATORS = re.compile(r"[\s_\-\u2010\u2011]+")


def folded_name(name: str) -> str:
    """What all spellings of a name have in common: `red cube` for `Red_Cube`, `red-cube` and `RED  cube`."""
    return _SEPARATORS.sub(" ", folded_characters(name)).strip()


def spelling_variants(names: Iterable[str]) -> list[tuple[str, str]]:
    """The pairs of different spellings among `names` that are one name."""
    first: dict[str, str] = {}
    pairs = ((first.setdefault(folded_name(name), name), name) for name in names)
    return [(one, other) for one, other in dict.fromkeys(pairs) if one != other]


def check_object_names(given: Sequence[str], names: Sequence[str], needed: Collection[str] | None = None) -> None:
    """Refuse object names that are not those of the task.

    A name must be spelled as the task spells it, and no two may differ in case, width or separators only: an
    instruction could not tell them apart.

    Args:
        needed: the names that must be given; the others may be missing, and new ones may be given. None: exactly
            `names`.

    Raises:
        ObjectSetError: names what is missing, unknown, given twice or too much alike.
    """
    spelled = {folded_name(name): name for name in names}
    missing = [name for name in names if name not in given and (needed is None or name in needed)]
    unknown = [
        f"{name} (here: {spelled[folded_name(name)]})" if folded_name(name) in spelled else name
        for name in dict.fromkeys(given)
        if name not in names and (needed is None or folded_name(name) in spelled)
    ]
    twice = sorted(f"{name} (name them '{name} 1', '{name} 2')" for name in set(given) if list(given).count(name) > 1)
    same = [f"{one} and {other}" for one, other in spelling_variants(given)]
    differences = {"missing": missing, "not of this task": unknown, "given twice": twice, "one name": same}
    if said := "; ".join(f"{what}: {', '.join(which)}" for what, which in differences.items() if which):
        raise ObjectSetError("objects", said, ", ".join(names))


def checked_aliases(aliases: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """Return the aliases by object, checked: each may stand in an instruction and belongs to one object only.

    Raises:
        InvalidInputError: names the alias and the object that has it already.
    """
    owners = {form: name for name in aliases for form in _singular_and_plurals(name)}
    for name, words in aliases.items():
        checked_object_name("aliases", name)
        for word in words:
            field = f"aliases[{name}]"
            forms = _singular_and_plurals(checked_object_name(field, word))
            owner = next((owners[form] for form in forms if owners.get(form, name) != name), name)
            owners |= dict.fromkeys(forms, owner)
            if owner != name:
                raise InvalidInputError(field, f"{word!r} stands for {owner!r} already", "a word of one object only")
    return {name: tuple(words) for name, words in aliases.items()}


def check_aliases_of(aliases: Mapping[str, Sequence[str]], names: Sequence[str]) -> None:
    """Refuse aliases of unknown objects, those that may be said of another object, too, and those that name nothing.

    With the alias "azure" for a red cube, beside a blue cube, "pick up the azure cube" could move the red one.

    Args:
        names: the task's objects.
    """
    for name, words in aliases.items():
        field = f"aliases[{name}]"
        if name not in names:
            raise InvalidInputError(field, "is no object of the task", ", ".join(names))
        for word in words:
            if vocabulary.NAMELESS.issuperset(phrase_of(word)):
                raise InvalidInputError(field, f"{word!r} names nothing by itself", "a noun")
            if other := next((other for other in names if other != name and _may_mean(other, word)), None):
                message = f"{word!r} may also mean {other!r}, by its name or its color"
                raise InvalidInputError(field, message, "words that fit no other object")


def shared_aliases(of_tasks: Sequence[Mapping[str, Sequence[str]]], names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return the aliases from several tasks, by object, without those that also fit another object of the scene.

    Args:
        of_tasks: the aliases of each task.
        names: the objects of the scene.
    """
    words = {name: tuple(dict.fromkeys(word for of in of_tasks for word in of.get(name, ()))) for name in names}

    def is_own(name: str, word: str) -> bool:
        others = (called for other in names if other != name for called in (other, *words[other]))
        return not any(_may_mean(called, word) for called in others)

    return {name: tuple(word for word in words[name] if is_own(name, word)) for name in names}


def _may_mean(name: str, words: str) -> bool:
    """Return whether the words may be said of an object with this name: a part of it, or a color like its own alone."""
    said = set(phrase_of(words)) - vocabulary.NAMELESS - vocabulary.SHADES_OF - vocabulary.COLORED
    own = vocabulary.COLORS.keys() & phrase_of(name)
    is_color = bool(said) and said <= vocabulary.COLORS.keys()
    return _contains(name, words) or (
        is_color and any(vocabulary.look_alike(one, other) for one in said for other in own)
    )


def _contains(name: str, words: str) -> bool:
    shown, said = folded_name(name).split(), folded_name(words).split()
    starts = range(len(shown) - len(said) + 1)
    return any(
        all(one in {other, *plurals_of(other), *singulars_of(other)} for one, other in zip(part, said, strict=True))
        for part in (shown[k : k + len(said)] for k in starts)
    )


def _singular_and_plurals(words: str) -> tuple[str, ...]:
    said = folded_name(words)
    before, space, last = said.rpartition(" ")
    return (said, *(f"{before}{space}{plural}" for plural in plurals_of(last)))
