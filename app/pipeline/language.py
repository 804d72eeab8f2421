"""What an instruction says about the objects: which it names, in which order, and of how many clauses it consists."""

import re
from collections.abc import Sequence

CLAUSE_SEPARATOR = re.compile(r"\s*,\s*(?:and\s+)?then\s+|\s+(?:and\s+)?then\s+", re.IGNORECASE)


def mention_order(names: Sequence[str], instruction: str) -> tuple[str, ...]:
    """Those of `names` that the instruction mentions, by their first mention ('_' in a name counts as a space)."""
    text = _spaced(instruction)
    found: dict[str, int] = {}
    for name in sorted(names, key=len, reverse=True):
        if match := re.search(rf"\b{re.escape(_spaced(name))}\b", text):
            found[name] = match.start()
            # a name inside a longer name ("cup" in "cup holder") must not count as mentioned
            text = text[: match.start()] + "\0" * len(match.group()) + text[match.end() :]
    return tuple(sorted(found, key=found.__getitem__))


def template(names: Sequence[str], instruction: str) -> str:
    """The instruction with the objects it mentions replaced by their place in the order of mention.

    "push the red button" and "push the blue button" share the template "push the #0": they ask for the same thing of
    another object.
    """
    text = _spaced(instruction)
    numbered = {name: f"#{k}" for k, name in enumerate(mention_order(names, instruction))}
    for name in sorted(numbered, key=len, reverse=True):
        text = re.sub(rf"\b{re.escape(_spaced(name))}\b", numbered[name], text)
    return text


def num_clauses(instruction: str) -> int:
    """How many steps the instruction strings together with "then"."""
    return len(CLAUSE_SEPARATOR.split(instruction.strip()))


def _spaced(text: str) -> str:
    return text.lower().replace("_", " ").strip().rstrip(".")
