"""Names of objects: when two spellings are one name, and whether given names are those of a task.

Instructions, prompts, settings and the store must all mean the same object by a name.
"""

import re
import unicodedata
from collections.abc import Collection, Iterable, Sequence

from app.pipeline.errors import ObjectSetError

_SEPARATORS = re.compile(r"[\s_\-\u2010\u2011]+")


def folded_characters(text: str) -> str:
    """The text without differences of case, width or Unicode form (NFKC)."""
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())


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
    twice = sorted({name for name in given if list(given).count(name) > 1})
    same = [f"{one} and {other}" for one, other in spelling_variants(given)]
    differences = {"missing": missing, "not of this task": unknown, "given twice": twice, "one name": same}
    if said := "; ".join(f"{what}: {', '.join(which)}" for what, which in differences.items() if which):
        raise ObjectSetError("objects", said, ", ".join(names))
