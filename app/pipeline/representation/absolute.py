"""The paper's representation: each action is seven bins in the world frame (section III-C and III-D).

A reply is one list of rows of integers, ``[[46, 74, ...], ...]``: what the paper's prompt asks for.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from app.pipeline.episode import Demonstration, Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.representation.base import Codec, Decoder, row_count_bounds
from app.pipeline.workspace import (
    POSITION_BINS,
    ROTATION_BINS,
    Workspace,
    discretize_actions,
    object_bins,
    undiscretize_actions,
)
from roboprompt_client.types.poses import EndEffectorAction

_FENCED = re.compile(r"```(?:json)?\s*(.*?)```", re.DOTALL)
_LIST_START = re.compile(r"\s*(?:```(?:json)?\s*)?\[\s*(?=\[)")
_NEXT_ROW = re.compile(r"[\s,]*(\[[^\[\]{}]*\])")
_ACTION_LIST = re.compile(r"\[\s*[-+\d\[]")


class Column(NamedTuple):
    """One integer of a row: its name and the values that it may have, both ends included."""

    name: str
    low: int
    high: int


def list_schema(columns: Sequence[Column], fewest: int, most: int) -> Mapping[str, object]:
    """The JSON Schema of a list of `fewest` to `most` rows."""
    row = {
        "type": "array",
        "prefixItems": [{"type": "integer", "minimum": low, "maximum": high} for _, low, high in columns],
        "minItems": len(columns),
        "maxItems": len(columns),
    }
    return {"type": "array", "items": row, "minItems": fewest, "maxItems": most}


def row_integers(row: str, index: int, columns: Sequence[Column]) -> tuple[int, ...]:
    """The integers of the row at `index`, one in range for each column; an integral float counts as one.

    Raises:
        ReplyParseError: naming the action and the column.
    """
    try:
        values = json.loads(row)
    except ValueError:
        raise ReplyParseError(f"action {index} is not a list of numbers", row) from None
    if len(values) != len(columns):
        raise ReplyParseError(f"action {index} has {len(values)} elements, expected {len(columns)} numbers", row)
    return tuple(_integer(value, index, column, row) for value, column in zip(values, columns, strict=True))


def _integer(value: object, index: int, column: Column, row: str) -> int:
    name, low, high = column
    if isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high and value == int(value):
        return int(value)
    raise ReplyParseError(f"action {index}: {name} is {value!r:.40}, expected an integer from {low} to {high}", row)


def _complete_rows(reply_text: str) -> Iterator[str]:
    """The rows that are closed in the list that begins a reply that still arrives.

    A list after other words may be a draft: only the whole reply shows whether it is the one list.
    """
    match = _LIST_START.match(reply_text)
    while match and (match := _NEXT_ROW.match(reply_text, match.end())):
        yield match.group(1)


def _single_list(reply_text: str) -> list[object]:
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


@dataclass(frozen=True, eq=False)
class AbsoluteCodec(Codec):
    """``{'drawer': [42, 65, 29], 'open the drawer'}>[[46, 74, 55, 54, 36, 37, 1], ...], ``.

    Attributes:
        with_instruction: whether the observation ends with the instruction (`paper`) or not (`authors`).
        columns, row_rules: of a row: its integers, and its grammar.
    """

    workspace: Workspace
    demonstrations: tuple[Demonstration, ...]
    with_instruction: bool
    stop: ClassVar[tuple[str, ...]] = ("{'",)  # the next observation
    separator: ClassVar[str] = ", "
    columns: ClassVar[Sequence[Column]] = (
        *(Column(name, 0, POSITION_BINS - 1) for name in ("x", "y", "z")),
        *(Column(name, 0, ROTATION_BINS - 1) for name in ("roll", "pitch", "yaw")),
        Column("gripper", 0, 1),
    )
    row_rules: ClassVar[str] = """row ::= "[" p ", " p ", " p ", " r ", " r ", " r ", " [01] "]"
p ::= [0-9] | [1-9] [0-9]
r ::= [0-9] | [1-6] [0-9] | "7" [01]
"""

    def needed(self) -> tuple[Demonstration, ...]:
        return self.demonstrations

    def observation_text(self, query: Query) -> str:
        parts = [f"'{pose.name}': {list(object_bins(pose, self.workspace))}" for pose in query.objects]
        if self.with_instruction:
            parts.append(f"'{query.instruction}'")
        return "{" + ", ".join(parts) + "}>"

    def actions_text(self, demonstration: Demonstration) -> str:
        return str([list(item.bins) for item in discretize_actions(demonstration.actions, self.workspace)])

    def grammar(self, query: Query, max_actions: int) -> str:
        fewest, most = row_count_bounds(self.demonstrations, query.order, max_actions)
        return f'root ::= "[" row (", " row){{{fewest - 1},{most - 1}}} "]"\n{self.row_rules}'

    def schema(self, query: Query, max_actions: int) -> Mapping[str, object]:
        return list_schema(self.columns, *row_count_bounds(self.demonstrations, query.order, max_actions))

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        if complete:
            return [json.dumps(row) for row in _single_list(reply_text)]
        return list(_complete_rows(reply_text))

    def reply_text(self, rows: Sequence[str]) -> str:
        return f"[{', '.join(rows)}]"

    def decoder(self, query: Query) -> Decoder:
        return self._actions

    def _actions(self, first: int, rows: Sequence[str]) -> list[EndEffectorAction]:
        bins = [row_integers(row, index, self.columns) for index, row in enumerate(rows, start=first)]
        return undiscretize_actions(bins, self.workspace)
