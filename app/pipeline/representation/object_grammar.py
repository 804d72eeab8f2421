"""The grammar of replies of `object_frame`, in GBNF.

It has for each row of a plan its anchor, and a range for every number. The ranges are what the demonstrations show,
with a margin; a single demonstration leaves none, so that it is copied.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from app.pipeline.episode import Demonstration, in_order
from app.pipeline.groups import places_by
from app.pipeline.order.order import Order
from app.pipeline.representation.anchors import Anchor, AnchorFrame, asked_anchor
from app.pipeline.representation.base import row_count_bounds
from app.pipeline.representation.object_rows import TextRow, anchor_text, letter
from app.pipeline.workspace import ROTATION_BINS

MARGIN_UNITS = 2  # 1 cm
MARGIN_BINS = 1  # 5 degrees
MAX_LISTED = 100  # values; a wider range allows every number
_ANY_OFFSET = "[+-] [0-9]{1,3}"
_ANY_BIN = '[0-9] | [1-6] [0-9] | "7" [01]'
_GRAMMAR_TAIL = """b ::= d " " d " " d " " r " " r " " r " " [01]
s ::= d " " d " " d (" " r " " r " " r)? " " [01]
d ::= [+-] ([0-9] | [1-9] [0-9] | [1-9] [0-9] [0-9])
r ::= [0-9] | [1-6] [0-9] | "7" [01]
"""


@dataclass(frozen=True)
class RowPattern:
    """One row of a plan.

    Attributes:
        anchors: as rows write them, e.g. `A w`.
        offsets: of each axis the values that demonstrations show.
        bins: the same of each rotation.
        grippers: the same of the gripper.
        repeats: whether the rotation is left out, being that of the row before, in each demonstration.
    """

    anchors: tuple[str, ...]
    offsets: tuple[frozenset[int], ...]
    bins: tuple[frozenset[int], ...]
    grippers: frozenset[int]
    repeats: frozenset[bool]
    single: bool

    def grammar(self, number: int) -> str:
        """The row with its number, in GBNF."""
        offsets = " ".join(f'" " {_offset(values, self.single)}' for values in self.offsets)
        gripper = _one_of(str(value) for value in sorted(self.grippers))
        anchor = _one_of(sorted(self.anchors))
        return f'"{number} " {anchor} ":" {offsets}{self._rotation()} " " {gripper}'

    def _rotation(self) -> str:
        if self.repeats == {True}:
            return ""
        bins = " ".join(f'" " {_bin(values, self.single)}' for values in self.bins)
        return f" ({bins})?" if True in self.repeats else f" {bins}"


PlanPattern = Sequence[RowPattern]
Table = Sequence[Sequence[TextRow]]  # [demonstration][row]


def plans_of(demonstrations: Sequence[Demonstration], table: Table, asked: Order) -> list[PlanPattern] | None:
    """The patterns of each plan's rows; None where the rows of several demonstrations must be strung together.

    Plans of demonstrations that ask for the same as the order, or where none does of those with as many clauses.
    """
    groups = places_by(demonstrations, attrgetter("kind"))
    as_long = [
        places for places in groups.values() if len(demonstrations[places[0]].order.clauses) == len(asked.clauses)
    ]
    if not as_long:
        return None
    chosen = [places for (form, *_), places in groups.items() if form == asked.form] or as_long
    return [
        _patterns([demonstrations[place] for place in places], [table[place] for place in places], asked)
        for places in chosen
    ]


def _patterns(shown: Sequence[Demonstration], table: Table, asked: Order) -> list[RowPattern]:
    """A pattern for each row of the plan that these demonstrations share."""
    by_row = list(zip(*table, strict=True))
    patterns = []
    for rows, before in zip(by_row, [(None,) * len(shown), *by_row], strict=False):
        numbers = np.array([row.numbers for row in rows])
        anchors = {
            anchor_text(asked_anchor(row.anchor, item.order, asked), item.objects, asked)
            for row, item in zip(rows, shown, strict=True)
        }
        columns = [frozenset(column.tolist()) for column in numbers.T]
        patterns.append(
            RowPattern(
                anchors=tuple(anchors),
                offsets=tuple(columns[:3]),
                bins=tuple(columns[3:]),
                grippers=frozenset(int(row.gripper_open) for row in rows),
                repeats=frozenset(row.turned_as(last) for row, last in zip(rows, before, strict=True)),
                single=len(rows) == 1,
            )
        )
    return patterns


def plans_grammar(plans: Sequence[PlanPattern], most: int) -> str:
    """The grammar of replies that carry out one of the plans, up to `most` rows of it."""
    written = dict.fromkeys(
        ' "; " '.join(row.grammar(number) for number, row in enumerate(plan[:most], start=1)) for plan in plans
    )
    names = [f"plan{k}" for k in range(len(written))]
    rules = "".join(f"{name} ::= {text}\n" for name, text in zip(names, written, strict=True))
    return f'root ::= " " ({" | ".join(names)}) "\\n"\n{rules}'


def any_rows_grammar(
    demonstrations: Sequence[Demonstration],
    frames: Sequence[AnchorFrame],
    by_axis: Iterable[tuple[Order, Anchor]],
    asked: Order,
    most: int,
) -> str:
    """The grammar of replies of well-formed rows, as many as the order's clauses have in the demonstrations.

    Args:
        frames: that a row may have at an object.
        by_axis: anchors with several origins, each with the order of its demonstration.
    """
    fewest, most = row_count_bounds(demonstrations, asked, most)
    rows = [f'"{number} " a ": " {"b" if number == 1 else "s"}' for number in range(1, most + 1)]
    optional = ""
    for row in reversed(rows[fewest:]):
        optional = f' ("; " {row}{optional})?'
    mixed = {anchor_text(asked_anchor(one, shown, asked), demonstrations[0].objects, asked) for shown, one in by_axis}
    anchors = " | ".join(f'"{anchor}"' for anchor in [*_anchors(demonstrations, frames, asked), *sorted(mixed)])
    required = ' "; " '.join(rows[:fewest])
    return f'root ::= " " {required}{optional} "\\n"\na ::= {anchors}\n{_GRAMMAR_TAIL}'


def _anchors(scenes: Sequence[Demonstration], frames: Sequence[AnchorFrame], asked: Order) -> list[str]:
    """Every letter and frame that the scenes' objects allow."""
    rotated = {pose.name for scene in scenes for pose in scene.objects if pose.quaternion_xyzw is not None}
    ordered = enumerate(in_order(scenes[0].objects, asked))
    return [f"{letter(k)} {frame}" for k, pose in ordered for frame in frames if frame == "w" or pose.name in rotated]


def _offset(values: frozenset[int], single: bool) -> str:
    margin = 0 if single else MARGIN_UNITS
    low, high = min(values) - margin, max(values) + margin
    return f"({_ANY_OFFSET})" if high - low >= MAX_LISTED else _one_of(f"{value:+d}" for value in range(low, high + 1))


def _bin(values: frozenset[int], single: bool) -> str:
    margin = 0 if single else MARGIN_BINS
    near = {(value + step) % ROTATION_BINS for value in values for step in range(-margin, margin + 1)}
    return f"({_ANY_BIN})" if len(near) >= ROTATION_BINS // 2 else _one_of(map(str, sorted(near)))


def _one_of(texts: Iterable[str]) -> str:
    listed = [f'"{text}"' for text in texts]
    return listed[0] if len(listed) == 1 else f"({' | '.join(listed)})"
