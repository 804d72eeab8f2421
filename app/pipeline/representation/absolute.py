"""The paper's representation: each action is seven bins in the world frame (section III-C and III-D)."""

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from app.pipeline.episode import Demonstration, EndEffectorAction, ObjectPose
from app.pipeline.errors import ReplyParseError
from app.pipeline.representation.base import row_count_bounds
from app.pipeline.workspace import (
    POSITION_BINS,
    ROTATION_BINS,
    Workspace,
    discretize_action,
    object_bins,
    undiscretize_action,
)

_NUMBERS = ("x", "y", "z", "roll", "pitch", "yaw", "gripper")
_LIMITS = (*(POSITION_BINS,) * 3, *(ROTATION_BINS,) * 3, 2)
_FENCED = re.compile(r"```(?:json)?\s*(.*?)```", re.DOTALL)
_LIST_START = re.compile(r"\[\s*(?=\[)")
_NEXT_ROW = re.compile(r"[\s,]*(\[[^\[\]{}]*\])")
_ACTION_LIST = re.compile(r"\[\s*[-+\d\[]")
_GRAMMAR = """root ::= "[" row (", " row){{{more_low},{more_high}}} "]"
row ::= "[" p ", " p ", " p ", " r ", " r ", " r ", " [01] "]"
p ::= [0-9] | [1-9] [0-9]
r ::= [0-9] | [1-6] [0-9] | "7" [01]
"""


@dataclass(frozen=True, eq=False)
class AbsoluteCodec:
    """``{'drawer': [42, 65, 29], 'open the drawer'}>[[46, 74, 55, 54, 36, 37, 1], ...], ``.

    Attributes:
        with_instruction: whether the observation ends with the instruction (`paper`) or not (`authors`).
    """

    workspace: Workspace
    demonstrations: tuple[Demonstration, ...]
    with_instruction: bool
    stop: tuple[str, ...] = ("{'",)  # the next observation

    @classmethod
    def fit(
        cls, demonstrations: Sequence[Demonstration], workspace: Workspace, with_instruction: bool
    ) -> "AbsoluteCodec":
        """The codec for `demonstrations`: of them it only needs the number of rows."""
        return cls(workspace, tuple(demonstrations), with_instruction)

    def observation_text(self, objects: Sequence[ObjectPose], instruction: str) -> str:
        parts = [f"'{pose.name}': {list(object_bins(pose, self.workspace))}" for pose in objects]
        if self.with_instruction:
            parts.append(f"'{instruction}'")
        return "{" + ", ".join(parts) + "}>"

    def actions_text(self, demonstration: Demonstration) -> str:
        return str([list(discretize_action(action, self.workspace).bins) for action in demonstration.actions])

    def demonstration_text(self, demonstration: Demonstration) -> str:
        observation = self.observation_text(demonstration.objects, demonstration.instruction)
        return f"{observation}{self.actions_text(demonstration)}, "

    def grammar(self, instruction: str, max_actions: int) -> str:
        fewest, most = row_count_bounds(self.demonstrations, instruction, max_actions)
        return _GRAMMAR.format(more_low=fewest - 1, more_high=most - 1)

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        if complete:
            return [json.dumps(row) for row in _single_list(reply_text)]
        return list(_complete_rows(reply_text))

    def decode_row(self, index: int, row: str, objects: Sequence[ObjectPose]) -> EndEffectorAction:
        return undiscretize_action(_bins(row, index), self.workspace)


def _complete_rows(reply_text: str) -> Iterator[str]:
    """The rows that are closed in the first list of lists of a reply that still arrives."""
    match = _LIST_START.search(reply_text)
    while match and (match := _NEXT_ROW.match(reply_text, match.end())):
        yield match.group(1)


def _single_list(reply_text: str) -> list[object]:
    """The one list of rows in a reply that may wrap it in prose or in a code fence."""
    fenced = _FENCED.findall(reply_text)
    if len(fenced) > 1:
        raise ReplyParseError(f"the reply has {len(fenced)} code fences, expected one list of actions", reply_text)
    lists = list(_lists_of_actions(fenced[0] if fenced else reply_text))
    if len(lists) != 1:
        raise ReplyParseError(f"the reply has {len(lists)} lists of actions, expected one", reply_text)
    found = lists[0]
    rows: list[object] = found if isinstance(found[0], list) else [found]
    for index, row in enumerate(rows):
        if not isinstance(row, list) or any(isinstance(value, list | dict) for value in row):
            raise ReplyParseError(f"action {index} is not a list of numbers", reply_text)
    return rows


def _lists_of_actions(text: str) -> Iterator[list[object]]:
    """Each outermost JSON list in `text` that begins like a row or a list of rows."""
    decoder = json.JSONDecoder()
    end = 0
    while match := _ACTION_LIST.search(text, end):
        try:
            value, end = decoder.raw_decode(text, match.start())
        except (ValueError, RecursionError):
            raise ReplyParseError("the reply's list of actions is not complete or not valid", text) from None
        yield value


def _bins(row: str, index: int) -> tuple[int, ...]:
    """Seven integers in range, of which an integral float counts as one."""
    try:
        values = json.loads(row)
    except ValueError:
        raise ReplyParseError(f"action {index} is not a list of numbers", row) from None
    if len(values) != len(_NUMBERS):
        raise ReplyParseError(f"action {index} has {len(values)} elements, expected {len(_NUMBERS)} numbers", row)
    named = zip(values, _NUMBERS, _LIMITS, strict=True)
    return tuple(_integer(value, f"action {index}: {name}", limit, row) for value, name, limit in named)


def _integer(value: object, name: str, limit: int, row: str) -> int:
    if isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < limit and value == int(value):
        return int(value)
    raise ReplyParseError(f"{name} is {value!r:.40}, expected an integer from 0 to {limit - 1}", row)
