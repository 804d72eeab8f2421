"""Names and instructions: what people say, and prompts repeat."""

import re
from collections.abc import Mapping, Sequence

from app.pipeline.errors import InvalidInputError

# Names and instructions become part of the prompt: the characters that give the prompt its structure stay out of them.
NAME_PATTERN = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9 _.\-]{0,62}[A-Za-z0-9])?")
MAX_NAME_CHARS = 64  # as the pattern and the store have it
MAX_INSTRUCTION_CHARS = 500
NAME_RULE = "1 to 64 letters, digits, spaces, '_', '-' or '.', beginning and ending with a letter or digit"
# Besides: control characters, line separators, surrogates, and what is invisible or turns the direction of writing, in
# which a reader would not see what the LLM reads. The joiners U+200C and U+200D belong to the spelling of languages.
INSTRUCTION_FORBIDDEN = re.compile(
    r"[\x00-\x1f\x7f-\x9f{}\[\]<>;\u00ad\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ud800-\udfff"
    r"\ufeff\ufff9-\uffff\U000e0000-\U000e0fff]"
)
INSTRUCTION_RULE = "1 to 500 visible characters on one line, without { } [ ] < > ;"


def checked_name(name: str, value: str) -> str:
    """`value` if it may stand in a prompt as an object's, camera's or task's name."""
    if not NAME_PATTERN.fullmatch(value):
        raise InvalidInputError(name, f"{value[:80]!r} is not a valid name", NAME_RULE)
    return value


def checked_instruction(name: str, value: str) -> str:
    """`value` stripped, if it may stand in a prompt as an instruction."""
    text = value.strip()
    if not 1 <= len(text) <= MAX_INSTRUCTION_CHARS or INSTRUCTION_FORBIDDEN.search(text):
        raise InvalidInputError(name, f"{text[:80]!r} is not a valid instruction", INSTRUCTION_RULE)
    return text


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
