"""Names and instructions: what people say, and prompts repeat."""

from collections.abc import Mapping, Sequence

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.wording import checked_name


def checked_aliases(aliases: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """The aliases by object, if each may stand in an instruction and belongs to one object only.

    Raises:
        InvalidInputError: names the alias and the object that has it already.
    """
    owners = {_as_said(name): name for name in aliases}
    for name, words in aliases.items():
        checked_name("aliases", name)
        for word in words:
            field = f"aliases[{name}]"
            owner = owners.setdefault(_as_said(checked_name(field, word)), name)
            if owner != name:
                raise InvalidInputError(field, f"{word!r} stands for {owner!r} already", "a word of one object only")
    return {name: tuple(words) for name, words in aliases.items()}


def check_aliases_of(aliases: Mapping[str, Sequence[str]], names: Sequence[str]) -> None:
    """Refuse aliases of what is no object, and aliases that are another object's name.

    Args:
        names: the task's objects.
    """
    by_name = {_as_said(name): name for name in names}
    for name, words in aliases.items():
        if name not in names:
            raise InvalidInputError(f"aliases[{name}]", "is no object of the task", ", ".join(names))
        for word in words:
            if by_name.get(_as_said(word), name) != name:
                raise InvalidInputError(f"aliases[{name}]", f"{word!r} is the name of another object", "another word")


def _as_said(name: str) -> str:
    return " ".join(name.replace("_", " ").lower().split())
