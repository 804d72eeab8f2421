"""The grammar of replies of `object_frame`, in GBNF.

It has for each row of a plan its frame, and a range for every number: where most further demonstrations would lie.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.order.order import Order
from app.pipeline.representation.base import row_count_bounds
from app.pipeline.representation.frame_text import frame_text
from app.pipeline.representation.object_rows import OFFSET_UNIT_M, TextRow
from app.pipeline.workspace import ROTATION_BIN_DEG, ROTATION_BINS

COMMON = 0.95  # share of further demonstrations that the range of a number holds
MAX_LISTED = 100  # values; a wider range allows every number
_ANY_OFFSET = "[+-] [0-9]{1,3}"
_ANY_BIN = '[0-9] | [1-6] [0-9] | "7" [01]'
_GRAMMAR_TAIL = """b ::= d " " d " " d " " r " " r " " r " " [01]
s ::= d " " d " " d (" " r " " r " " r)? " " [01]
d ::= [+-] ([0-9] | [1-9] [0-9] | [1-9] [0-9] [0-9])
r ::= [0-9] | [1-6] [0-9] | "7" [01]
"""
Rows = Sequence[TextRow]


def plans_grammar(
    shown: Sequence[tuple[Order, Rows]], letters: Mapping[str, str], asked: Order, most: int
) -> str | None:
    """The grammar of replies that carry out one of the plans, up to `most` rows of it.

    The plans are those of demonstrations that ask for the same as the order, or where none does of those with as many
    clauses. None where the rows of several demonstrations must be strung together.

    Args:
        shown: of each demonstration its order and rows.
        letters: of the objects by their keys.
    """
    as_long = [(order, rows) for order, rows in shown if len(order.clauses) == len(asked.clauses)]
    same = [(order, rows) for order, rows in as_long if order.form == asked.form]
    plans = dict.fromkeys(_plan(tuple(rows[:most]), letters) for _, rows in same or as_long)
    names = {text: f"plan{k}" for k, text in enumerate(text for text in plans if text)}
    if not names:
        return None
    rules = "".join(f"{name} ::= {text}\n" for text, name in names.items())
    return f'root ::= " " ({" | ".join(names.values())}) "\\n"\n{rules}'


def _plan(rows: Rows, letters: Mapping[str, str]) -> str:
    """The rows of a plan; empty where a scene lacks an object that they follow."""
    texts, before = [], None
    for number, row in enumerate(rows, start=1):
        if (frame := frame_text(row.frame, letters)) is None:
            return ""
        texts.append(f'"{number} " "{frame}" ":" {_numbers(row, before)}')
        before = row
    return ' "; " '.join(texts)


def _numbers(row: TextRow, before: TextRow | None) -> str:
    """The numbers of a row and its gripper; a rotation that repeats the row before is left out."""
    within = row.row.within(COMMON)
    units = np.rint(within[:3] / OFFSET_UNIT_M).astype(int).tolist()
    bins = np.rint(np.degrees(within[3:]) / ROTATION_BIN_DEG).astype(int).tolist()
    offsets = [f'" " {_offset(value, margin)}' for value, margin in zip(row.numbers, units, strict=False)]
    rotation = [f'" " {_bin(value, margin)}' for value, margin in zip(row.numbers[3:], bins, strict=True)]
    repeats = before is not None and row.numbers[3:] == before.numbers[3:]
    return " ".join([*offsets, *(() if repeats else rotation), '" "', f'"{int(row.gripper_open)}"'])


def any_rows_grammar(demonstrations: Sequence[Demonstration], frames: Collection[str], asked: Order, most: int) -> str:
    """The grammar of replies of well-formed rows, as many as the order's clauses have in the demonstrations.

    Args:
        frames: that a row may have.
    """
    fewest, most = row_count_bounds(demonstrations, asked, most)
    rows = [f'"{number} " a ": " {"b" if number == 1 else "s"}' for number in range(1, most + 1)]
    optional = ""
    for row in reversed(rows[fewest:]):
        optional = f' ("; " {row}{optional})?'
    required = ' "; " '.join(rows[:fewest])
    texts = " | ".join(f'"{frame}"' for frame in frames)
    return f'root ::= " " {required}{optional} "\\n"\na ::= {texts}\n{_GRAMMAR_TAIL}'


def _offset(value: int, margin: int) -> str:
    every = 2 * margin >= MAX_LISTED
    return f"({_ANY_OFFSET})" if every else _one_of(f"{near:+d}" for near in range(value - margin, value + margin + 1))


def _bin(value: int, margin: int) -> str:
    near = {(value + step) % ROTATION_BINS for step in range(-margin, margin + 1)}
    return f"({_ANY_BIN})" if len(near) >= ROTATION_BINS // 2 else _one_of(map(str, sorted(near)))


def _one_of(texts: Iterable[str]) -> str:
    listed = [f'"{text}"' for text in texts]
    return listed[0] if len(listed) == 1 else f"({' | '.join(listed)})"
