"""Names and instructions: what people say, and prompts repeat."""

import re

from roboprompt_client.errors import InvalidInputError

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
