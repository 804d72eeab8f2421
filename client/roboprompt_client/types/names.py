"""Which names and instructions are valid: both become part of a prompt."""

import re
import unicodedata

from roboprompt_client.errors import InvalidInputError

# The characters that structure a prompt are not allowed in names and instructions.
NAME_PATTERN = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9 _.\-]{0,62}[A-Za-z0-9])?")
MAX_INSTRUCTION_CHARS = 500
NAME_RULE = "1 to 64 letters, digits, spaces, '_', '-' or '.', beginning and ending with a letter or digit"
MAX_NAME_CHARS = 64
JOINERS = "\u200c\u200d"  # stand within words of Arabic and Indic scripts
# Also forbidden: control characters, line separators, surrogates, and characters that are invisible or change the
# direction of writing, so that a person would see another text than the LLM reads. The joiners U+200C and U+200D are
# allowed, because some languages need them.
INSTRUCTION_FORBIDDEN = re.compile(
    r"[\x00-\x1f\x7f-\x9f{}\[\]<>;\u00ad\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ud800-\udfff"
    r"\ufeff\ufff9-\uffff\U000e0000-\U000e0fff]"
)
INSTRUCTION_RULE = "1 to 500 visible characters on one line, without { } [ ] < > ;"


def checked_name(name: str, value: str) -> str:
    """Return `value` if it is a valid name of a camera, task or key, else raise InvalidInputError naming `name`."""
    if not NAME_PATTERN.fullmatch(value):
        raise InvalidInputError(name, f"{value[:80]!r} is not a valid name", NAME_RULE)
    return value


def checked_object_name(name: str, value: str) -> str:
    """Return `value` if it is a valid name of an object, with letters of any script, else raise InvalidInputError."""
    kinds = [unicodedata.category(character)[0] for character in value]
    of_words = [kind in "LMN" for kind in kinds]
    allowed = all(known or c in f" _.-{JOINERS}" for known, c in zip(of_words, value, strict=True))
    if not (1 <= len(value) <= MAX_NAME_CHARS and allowed and kinds[0] in "LN" and of_words[-1]):
        raise InvalidInputError(name, f"{value[:80]!r} is not a valid name", NAME_RULE)
    return value


def checked_instruction(name: str, value: str) -> str:
    """Return `value` without surrounding spaces if it is a valid instruction, else raise InvalidInputError."""
    text = value.strip()
    if not 1 <= len(text) <= MAX_INSTRUCTION_CHARS or INSTRUCTION_FORBIDDEN.search(text):
        raise InvalidInputError(name, f"{text[:80]!r} is not a valid instruction", INSTRUCTION_RULE)
    return text
