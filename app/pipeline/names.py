"""When two spellings are one name: instructions, prompts, settings and the store must all mean the same object."""

import re
import unicodedata
from collections.abc import Iterable

_SEPARATORS = re.compile(r"[\s_\-\u2010\u2011]+")


def folded_characters(text: str) -> str:
    """The text without differences of case, width or Unicode form (NFKC)."""
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())


def folded(name: str) -> str:
    """What all spellings of a name have in common: `red cube` for `Red_Cube`, `red-cube` and `RED  cube`."""
    return _SEPARATORS.sub(" ", folded_characters(name)).strip()


def alike(names: Iterable[str]) -> list[tuple[str, str]]:
    """The pairs of different spellings among `names` that are one name."""
    first: dict[str, str] = {}
    pairs = ((first.setdefault(folded(name), name), name) for name in names)
    return [(one, other) for one, other in dict.fromkeys(pairs) if one != other]
