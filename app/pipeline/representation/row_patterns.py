"""What rows of `object_frame` may say, as a grammar: for each row of a plan its anchor, and a range for every number.

The ranges are what the demonstrations show, with a margin; a single demonstration leaves none, so that it is copied.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from app.pipeline.workspace import ROTATION_BINS

MARGIN_UNITS = 2  # 1 cm
MARGIN_BINS = 1  # 5 degrees
MOST_LISTED = 100  # values; a wider range allows every number
_ANY_OFFSET = "[+-] [0-9]{1,3}"
_ANY_BIN = '[0-9] | [1-6] [0-9] | "7" [01]'


@dataclass(frozen=True)
class RowPattern:
    """One row of a plan.

    Attributes:
        anchors: as rows write them, e.g. `A w`.
        offsets: of each axis the values that demonstrations show.
        bins: the same of each rotation.
        grippers: the same of the gripper.
    """

    anchors: tuple[str, ...]
    offsets: tuple[frozenset[int], ...]
    bins: tuple[frozenset[int], ...]
    grippers: frozenset[int]
    single: bool

    def grammar(self, number: int) -> str:
        """The row with its number, in GBNF."""
        offsets = " ".join(f'" " {_offset(values, self.single)}' for values in self.offsets)
        bins = " ".join(f'" " {_bin(values, self.single)}' for values in self.bins)
        gripper = _one_of(str(value) for value in sorted(self.grippers))
        anchor = _one_of(sorted(self.anchors))
        return f'"{number} " {anchor} ":" {offsets} {bins} " " {gripper}'


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
