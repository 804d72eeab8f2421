"""What an instruction says about the objects: which it names, in which order, and of how many clauses it consists."""

import re
from collections.abc import Sequence

CLAUSE_SEPARATOR = re.compile(r"\s*,\s*(?:and\s+)?then\s+|\s+(?:and\s+)?then\s+", re.IGNORECASE)


def mention_order(names: Sequence[str], instruction: str) -> tuple[str, ...]:
    """Those of `names` that the instruction mentions, by their first mention ('_' in a name counts as a space)."""
    text = _spaced(instruction)
    found: dict[str, int] = {}
    for name in sorted(names, key=len, reverse=True):
        pattern = rf"\b{re.escape(_spaced(name))}\b"
        if match := re.search(pattern, text):
            found[name] = match.start()
            # a name inside a longer name ("cup" in "cup holder") must not count as mentioned
            text = re.sub(pattern, "\0" * len(match.group()), text)
    return tuple(sorted(found, key=found.__getitem__))


def template(names: Sequence[str], instruction: str) -> str:
    """The instruction with the objects it mentions replaced by their place in the order of mention.

    "push the red button" and "push the blue button" share the template "push the <0>": they ask for the same thing of
    another object.
    """
    text = _spaced(instruction)
    numbered = {_spaced(name): f"<{k}>" for k, name in enumerate(mention_order(names, instruction))}
    if not numbered:
        return text
    longest_first = "|".join(map(re.escape, sorted(numbered, key=len, reverse=True)))
    return re.sub(rf"\b(?:{longest_first})\b", lambda match: numbered[match.group()], text)


def num_clauses(instruction: str) -> int:
    """How many steps the instruction strings together with "then"."""
    return len(CLAUSE_SEPARATOR.split(instruction.strip()))


def _spaced(text: str) -> str:
    return text.lower().replace("_", " ").strip().rstrip(".")
