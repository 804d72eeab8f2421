"""The grammar of replies of `object_frame`, in GBNF.

It has for each row of a plan its anchor, and a range for every number. The ranges are what the demonstrations show,
with a margin; a single demonstration leaves none, so that it is copied.
"""

from collections.abc import Collection, Iterable, Sequence
from operator import attrgetter

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


Table = Sequence[Sequence[TextRow]]  # [demonstration][row]


def plans_grammar(demonstrations: Sequence[Demonstration], table: Table, asked: Order, most: int) -> str | None:
    """The grammar of replies that carry out one of the plans, up to `most` rows of it.

    The plans are those of demonstrations that ask for the same as the order, or where none does of those with as many
    clauses. None where the rows of several demonstrations must be strung together.
    """
    groups = places_by(demonstrations, attrgetter("kind"))
    as_long = [
        places for places in groups.values() if len(demonstrations[places[0]].order.clauses) == len(asked.clauses)
    ]
    if not as_long:
        return None
    chosen = [places for (form, *_), places in groups.items() if form == asked.form] or as_long
    plans = [
        _plan([demonstrations[place] for place in places], [table[place][:most] for place in places], asked)
        for places in chosen
    ]
    names = {text: f"plan{k}" for k, text in enumerate(dict.fromkeys(plans))}
    rules = "".join(f"{name} ::= {text}\n" for text, name in names.items())
    return f'root ::= " " ({" | ".join(names.values())}) "\\n"\n{rules}'


def _plan(shown: Sequence[Demonstration], table: Table, asked: Order) -> str:
    texts = []
    before: Sequence[TextRow] = ()
    for number, rows in enumerate(zip(*table, strict=True), start=1):
        anchors = {
            anchor_text(asked_anchor(row.anchor, item.order, asked), item.objects, asked)
            for row, item in zip(rows, shown, strict=True)
        }
        texts.append(f'"{number} " {_one_of(sorted(anchors))} ":" {_numbers(rows, before)}')
        before = rows
    return ' "; " '.join(texts)


def _numbers(rows: Sequence[TextRow], before: Sequence[TextRow]) -> str:
    """The numbers of one row of a plan and its gripper.

    Args:
        rows, before: of each demonstration the row, and the one before it; the first has none.
    """
    columns, single = list(zip(*(row.numbers for row in rows), strict=True)), len(rows) == 1
    offsets = " ".join(f'" " {_offset(values, single)}' for values in columns[:3])
    rotation = " ".join(f'" " {_bin(values, single)}' for values in columns[3:])
    repeats = {row.numbers[3:] == last.numbers[3:] for row, last in zip(rows, before, strict=False)}
    if True in repeats:  # a rotation that repeats the row before is left out
        rotation = f"({rotation})?" if False in repeats else ""
    gripper = _one_of(sorted({str(int(row.gripper_open)) for row in rows}))
    return " ".join(filter(None, [offsets, rotation, '" "', gripper]))


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
    rotated = {pose.name for scene in scenes for pose in scene.objects if pose.quaternion_xyzw is not None}
    ordered = enumerate(in_order(scenes[0].objects, asked))
    return [f"{letter(k)} {frame}" for k, pose in ordered for frame in frames if frame == "w" or pose.name in rotated]


def _offset(values: Collection[int], single: bool) -> str:
    margin = 0 if single else MARGIN_UNITS
    low, high = min(values) - margin, max(values) + margin
    return f"({_ANY_OFFSET})" if high - low >= MAX_LISTED else _one_of(f"{value:+d}" for value in range(low, high + 1))


def _bin(values: Collection[int], single: bool) -> str:
    margin = 0 if single else MARGIN_BINS
    near = {(value + step) % ROTATION_BINS for value in values for step in range(-margin, margin + 1)}
    return f"({_ANY_BIN})" if len(near) >= ROTATION_BINS // 2 else _one_of(map(str, sorted(near)))


def _one_of(texts: Iterable[str]) -> str:
    listed = [f'"{text}"' for text in texts]
    return listed[0] if len(listed) == 1 else f"({' | '.join(listed)})"
