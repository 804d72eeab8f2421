"""The rows of `object_frame`: fitted to demonstrations, written as text, and what they may say as a grammar.

The grammar has for each row of a plan its anchor, and a range for every number. The ranges are what the demonstrations
show, with a margin; a single demonstration leaves none, so that it is copied.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.pipeline.episode import Demonstration
from app.pipeline.language.mentions import template
from app.pipeline.representation.anchors import Anchor, choose_anchors, relative_action
from app.pipeline.workspace import ROTATION_BINS, rotation_bins

Integers = npt.NDArray[np.int_]

OFFSET_UNIT_M = 0.005
# Integers that differ by no more than this over the demonstrations are made equal: small models copy them better.
JITTER_UNITS = 1
MARGIN_UNITS = 2  # 1 cm
MARGIN_BINS = 1  # 5 degrees
MOST_LISTED = 100  # values; a wider range allows every number
_OFFSET = r"(?P<offset>[^:]*:(?: [+-]\d{1,3}){3})"
_ROTATION = re.compile(rf"{_OFFSET}(?P<rotation>(?: \d{{1,2}}){{3}})(?P<gripper> [01])", re.ASCII)
_NO_ROTATION = re.compile(rf"{_OFFSET}(?P<gripper> [01])", re.ASCII)
_ANY_OFFSET = "[+-] [0-9]{1,3}"
_ANY_BIN = '[0-9] | [1-6] [0-9] | "7" [01]'


@dataclass(frozen=True)
class Row:
    """One action in integers: the anchor, six numbers (offset in units, rotation bins) and the gripper."""

    anchor: Anchor
    numbers: tuple[int, ...]
    gripper_open: bool

    def turned_as(self, other: "Row | None") -> bool:
        """Whether it has the rotation numbers of the other row."""
        return other is not None and self.numbers[3:] == other.numbers[3:]


def groups_of(demonstrations: Sequence[Demonstration]) -> dict[tuple[str, int | None, int], list[int]]:
    """The places of demonstrations with the same rows: what they ask for, their plan and number of actions."""
    groups: dict[tuple[str, int | None, int], list[int]] = defaultdict(list)
    for place, demonstration in enumerate(demonstrations):
        names = [pose.name for pose in demonstration.objects]
        asks = template(names, demonstration.instruction)
        groups[asks, demonstration.plan, len(demonstration.actions)].append(place)
    return groups


def fit_rows(group: Sequence[Demonstration], tilted: frozenset[str]) -> list[tuple[Row, ...]]:
    """The rows of each demonstration of a group that asks for the same thing in the same number of actions."""
    fitted: list[list[Row]] = [[] for _ in group]
    planned = all(demonstration.plan is not None for demonstration in group)
    for k, anchors in enumerate(choose_anchors(group, tilted, beyond_objects=planned)):
        numbers = np.array([_integers(d, k, anchor, tilted) for d, anchor in zip(group, anchors, strict=True)])
        for rows, demonstration, anchor, values in zip(fitted, group, anchors, _calmed(numbers), strict=True):
            rows.append(Row(anchor, tuple(values.tolist()), demonstration.actions[k].gripper_open))
    return [tuple(rows) for rows in fitted]


def _integers(demonstration: Demonstration, k: int, anchor: Anchor, tilted: frozenset[str]) -> tuple[int, ...]:
    offset_m, rotation = relative_action(demonstration, k, anchor, tilted)
    return (*np.rint(offset_m / OFFSET_UNIT_M).astype(int).tolist(), *rotation_bins(rotation))


def _calmed(numbers: Integers) -> Integers:
    """(N, 6) integers of one row over N demonstrations; columns that differ by rounding only get their median."""
    reference = numbers[0].copy()
    reference[:3] = 0
    half = ROTATION_BINS // 2
    relative = numbers - reference
    relative[:, 3:] = (relative[:, 3:] + half) % ROTATION_BINS - half
    median = np.sort(relative, axis=0)[len(relative) // 2]
    calm = np.abs(relative - median).max(axis=0) <= JITTER_UNITS
    calmed: Integers = np.where(calm, median, relative) + reference
    calmed[:, 3:] %= ROTATION_BINS
    return calmed


def row_text(number: int, anchor: str, row: Row) -> str:
    """The row with all its numbers."""
    offset = " ".join(f"{value:+d}" for value in row.numbers[:3])
    rotation = " ".join(map(str, row.numbers[3:]))
    return f"{number} {anchor}: {offset} {rotation} {int(row.gripper_open)}"


def shortened(rows: Sequence[str]) -> list[str]:
    """The rows without the rotations that are those of the row before, as prompts show them and replies write them."""
    short, before = [], ""
    for row in rows:
        said = _ROTATION.fullmatch(row)
        repeats = said is not None and said["rotation"] == before
        short.append(f"{said['offset']}{said['gripper']}" if said and repeats else row)
        before = said["rotation"] if said else ""
    return short


def in_full(rows: Sequence[str]) -> list[str]:
    """The rows with the rotations that `shortened` leaves out; what is no such row stays as it is."""
    full, before = [], ""
    for row in rows:
        short = _NO_ROTATION.fullmatch(row)
        full.append(f"{short['offset']}{before}{short['gripper']}" if short and before else row)
        said = _ROTATION.fullmatch(full[-1])
        before = said["rotation"] if said else ""
    return full


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


Plan = Sequence[RowPattern]


def plans_grammar(plans: Sequence[Plan], first_row: int, most: int) -> str:
    """The grammar of replies that carry out one of the plans, up to `most` rows of it."""
    written = dict.fromkeys(
        ' "; " '.join(row.grammar(number) for number, row in enumerate(plan[:most], start=first_row)) for plan in plans
    )
    names = [f"plan{k}" for k in range(len(written))]
    rules = "".join(f"{name} ::= {text}\n" for name, text in zip(names, written, strict=True))
    return f'root ::= " " ({" | ".join(names)}) "\\n"\n{rules}'


def _offset(values: frozenset[int], single: bool) -> str:
    margin = 0 if single else MARGIN_UNITS
    low, high = min(values) - margin, max(values) + margin
    return f"({_ANY_OFFSET})" if high - low >= MOST_LISTED else _one_of(f"{value:+d}" for value in range(low, high + 1))


def _bin(values: frozenset[int], single: bool) -> str:
    margin = 0 if single else MARGIN_BINS
    near = {(value + step) % ROTATION_BINS for value in values for step in range(-margin, margin + 1)}
    return f"({_ANY_BIN})" if len(near) >= ROTATION_BINS // 2 else _one_of(map(str, sorted(near)))


def _one_of(texts: Iterable[str]) -> str:
    listed = [f'"{text}"' for text in texts]
    return listed[0] if len(listed) == 1 else f"({' | '.join(listed)})"
