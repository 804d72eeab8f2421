"""The parts of a prompt, to be shown in the paper's colors: object poses, actions, the instruction (figure 1)."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, cast

from app.pipeline.representation.base import SUMS_FORMAT
from app.pipeline.representation.frame_text import PATTERN

Kind = Literal["object", "action", "instruction", "separator", "plain"]


@dataclass(frozen=True)
class Span:
    """A piece of a prompt.

    Attributes:
        kind: `separator` ends a demonstration.
    """

    kind: Kind
    text: str


# {'drawer': [42, 65, 29], 'open the drawer'}>[[46, 74, 55, 54, 36, 37, 1], ...],
_LISTS = re.compile(
    r"(?P<object>'[^']*': \[[^\]]*\])"
    r"|(?P<instruction>'[^{}]*'(?=\}>))"
    r"|(?P<action>\[\[.*?\]\]|\[[-+\d., ]+\])"
    r"|(?P<separator>, (?=\{'|\Z))",
    re.DOTALL,
)
# {'drawer': [60,51,6,36,36,18] a(+0 +11 +6), 'open it'}>open it [1 drawer a +0 +11 +6: [60+0=60,...]; 2 drawer ...]
_SUMS = re.compile(
    r"(?P<object>'[^']*': \[[^\]]*\](?: [a-z]+\([^()]*\))*)"
    r"|(?P<instruction>'[^{}]*'(?=\}>))"
    r"|(?P<action>(?:(?<=\[)|(?<=; ))\d+ [^\[\];\n]+: \[[^\[\]\n]*\])"
    r"|(?P<separator>\n)"
)
# Objects: green block\nAt white plate: red block\nInstruction: build a tower\nSteps:\n1. grasp green block\n2. ...
_PARTS = re.compile(
    r"^(?P<object>(?:Objects|At [^:\n]+): [^\n]+)|(?<=^Instruction: )(?P<instruction>[^\n]+)"
    r"|^(?P<action>\d+\. [^\n]+)|(?P<separator>\n\n)",
    re.MULTILINE,
)
# A red button 40 41 17 36; push the red button > 1 A w: +0 +0 +14 36 36 0 0; 2 A w: +0 +0 +2 0; ...
_ANCHOR = PATTERN
_ROW = rf"(?P<action>\d+ {_ANCHOR}:(?: [+-]\d+){{3}}(?: \d+ \d+ \d+)? [01](?=;|\Z|\n))"
_OBJECT = r"(?:^|(?<=; ))(?P<object>[A-Z]+ [^;>\n]+?(?: \d+){3,6})"
_INSTRUCTION = r"(?:^|(?<=; ))(?P<instruction>[^;>\n]+)(?= >)"
_SEPARATOR = r"(?P<separator>\n)"
_OBJECT_FRAME = {
    "paper": re.compile(rf"{_ROW}|{_OBJECT}(?=; )|{_INSTRUCTION}|{_SEPARATOR}", re.MULTILINE | re.ASCII),
    "authors": re.compile(rf"{_ROW}|{_OBJECT}(?=; | >)|{_SEPARATOR}", re.MULTILINE | re.ASCII),
}


def prompt_spans(text: str, representation: str, prompt_format: str) -> tuple[Span, ...]:
    """A prompt or reply cut into spans that join to it again; what the representation does not write is `plain`."""
    if representation == "object_frame":
        return tuple(_cut(text, _OBJECT_FRAME.get(prompt_format, _LISTS)))
    if prompt_format == SUMS_FORMAT:
        return tuple(_cut(text, _SUMS))
    return tuple(_cut(text, _PARTS if representation == "parts" else _LISTS))


def _cut(text: str, pattern: re.Pattern[str]) -> Iterator[Span]:
    end = 0
    for match in pattern.finditer(text):
        if match.start() > end:
            yield Span("plain", text[end : match.start()])
        yield Span(cast("Kind", match.lastgroup), match.group())
        end = match.end()
    if end < len(text):
        yield Span("plain", text[end:])
