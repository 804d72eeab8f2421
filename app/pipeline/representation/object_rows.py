"""The rows of `object_frame`: fitted to demonstrations, written as text, and read from replies."""

import re
import string
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration, in_order
from app.pipeline.errors import ReplyParseError
from app.pipeline.order.order import Order
from app.pipeline.representation.anchor_choice import choose_anchors
from app.pipeline.representation.anchors import Anchor, AnchorPose, Anchors, relative_row
from app.pipeline.workspace import ROTATION_BINS, rotation_bins, rotation_from_bins
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

LETTERS = string.ascii_uppercase
Integers = npt.NDArray[np.int_]

OFFSET_UNIT_M = 0.005
# Integers that differ by no more than this over the demonstrations are made equal: small models copy them better.
JITTER_UNITS = 1
_ROW = re.compile(
    r"(\d{1,3}) ([A-Z]{1,2} (?:w|o|ow|wo)(?:>[A-Z]{1,2})?(?: [xyz]=\w+)*(?: [1-9]/10)?|world|start):"
    r" ([+-]\d{1,3}) ([+-]\d{1,3}) ([+-]\d{1,3}) (\d{1,2}) (\d{1,2}) (\d{1,2}) ([01])",
    re.ASCII,
)
_OFFSET = r"(?P<offset>[^:]*:(?: [+-]\d{1,3}){3})"
_ROTATION = re.compile(rf"{_OFFSET}(?P<rotation>(?: \d{{1,2}}){{3}})(?P<gripper> [01])", re.ASCII)
_NO_ROTATION = re.compile(rf"{_OFFSET}(?P<gripper> [01])", re.ASCII)


class RelativePose(NamedTuple):
    """A pose of the hand relative to an anchor: offset (3,) in meters, and rotation (4,)."""

    offset_m: Array
    rotation_xyzw: Array

    @classmethod
    def of_numbers(cls, numbers: Sequence[int]) -> "RelativePose":
        """The pose that six numbers of a row stand for by themselves."""
        return cls(OFFSET_UNIT_M * np.array(numbers[:3], dtype=float), rotation_from_bins(numbers[3:]).as_quat())


@dataclass(frozen=True)
class TextRow:
    """One action in integers.

    Attributes:
        numbers: the offset in units, and three rotation bins.
        mean: of the demonstrations that have this row with these numbers; None where it was not demonstrated.
    """

    anchor: Anchor
    numbers: tuple[int, ...]
    gripper_open: bool
    mean: RelativePose | None = field(default=None, compare=False, repr=False)


class Step(NamedTuple):
    """What a row of a plan does at an object, in whichever scene and whatever the object's name.

    Attributes:
        form: of the instruction.
        anchor: of the row, with the objects that the instruction mentions as roles, such as `<0>`.
        numbers: of the row, relative to the anchor.
    """

    form: str
    anchor: Anchor
    numbers: tuple[int, ...]

    @classmethod
    def of(cls, demonstration: Demonstration, row: TextRow) -> "Step":
        """The step of a demonstration's row."""
        order = demonstration.order
        roles = {name: order.placeholder(name) for name in order.objects}
        return cls(order.form, row.anchor.named(roles), row.numbers)

    def row(self, order: Order) -> TextRow:
        """The row, with the gripper open, where `order`, which has its form, is carried out."""
        names = {order.placeholder(name): name for name in order.objects}
        return TextRow(self.anchor.named(names), self.numbers, gripper_open=True)


def fit_rows(group: Sequence[Demonstration], tilted: frozenset[str]) -> list[tuple[TextRow, ...]]:
    """The rows of each demonstration of a group that asks for the same thing in the same number of actions."""
    planned = all(demonstration.plan is not None for demonstration in group)
    chosen = choose_anchors(group, tilted, beyond_objects=planned)
    rows = [_fit_row(group, k, anchors) for k, anchors in enumerate(chosen)]
    return [tuple(own[place] for own in rows) for place in range(len(group))]


def _fit_row(group: Sequence[Demonstration], k: int, anchors: Anchors) -> list[TextRow]:
    """TextRow `k` of each demonstration, relative to these anchors."""
    offsets_m, rotations = relative_row(group, k, anchors)
    offsets = np.rint(offsets_m / OFFSET_UNIT_M).astype(int)
    numbers = _calmed(np.concatenate([offsets, rotation_bins(rotations)], axis=1))
    means = _means(offsets_m, rotations, numbers)
    states = [demonstration.actions[k].gripper_open for demonstration in group]
    own = zip(anchors, map(tuple, numbers.tolist()), states, means, strict=True)
    return [TextRow(*row) for row in own]


def _means(offsets_m: Array, rotations: Rotation, numbers: Integers) -> list[RelativePose]:
    """The offsets (N, 3) and N rotations, each axis and the rotation averaged over those with equal numbers (N, 6)."""
    by_axis = zip(numbers.T[:3], offsets_m.T, strict=True)
    means_m = np.column_stack([_mean_of_equal(axis_numbers, axis_m) for axis_numbers, axis_m in by_axis])
    _, groups = np.unique(numbers[:, 3:], axis=0, return_inverse=True)
    hands = [rotations[groups == group].mean().as_quat() for group in range(groups.max() + 1)]
    return [RelativePose(mean_m, hands[group]) for mean_m, group in zip(means_m, groups, strict=True)]


def _mean_of_equal(keys: Integers, values: Array) -> Array:
    _, groups = np.unique(keys, return_inverse=True)
    means: Array = (np.bincount(groups, values) / np.bincount(groups))[groups]
    return means


def actions_at(
    anchored: Sequence[AnchorPose], poses: Sequence[RelativePose], grippers: Sequence[bool]
) -> list[EndEffectorAction]:
    """The actions of rows in a scene: of each what it is relative to, and its pose seen from there."""
    offsets_m, rotations = map(np.array, zip(*poses, strict=True))
    positions_m, hands = AnchorPose.stacked(anchored).placed(offsets_m, Rotation.from_quat(rotations))
    return EndEffectorAction.many(positions_m, hands.as_quat(canonical=True), grippers)


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


def row_text(number: int, anchor: str, row: TextRow) -> str:
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
    """The rows with the rotations that `shortened` leaves out; other texts stay as they are."""
    full, before = [], ""
    for row in rows:
        short = _NO_ROTATION.fullmatch(row)
        full.append(f"{short['offset']}{before}{short['gripper']}" if short and before else row)
        said = _ROTATION.fullmatch(full[-1])
        before = said["rotation"] if said else ""
    return full


def read_row(index: int, row: str, anchors: Collection[str]) -> tuple[str, tuple[int, ...]]:
    """The anchor of a row in full, as the row has it, and its seven numbers.

    Args:
        index: of the row in the reply, from 0.
        anchors: that a row may have.

    Raises:
        ReplyParseError: naming the action and what was expected.
    """
    match = _ROW.fullmatch(row)
    if not match:
        expected = f"'{index + 1} A w: +x +y +z roll pitch yaw gripper'"
        raise ReplyParseError(f"action {index} is {row[:80]!r}, expected {expected}", row)
    number, anchor, *texts = match.groups()
    if int(number) != index + 1:
        raise ReplyParseError(f"action {index} has row number {number}, expected {index + 1}", row)
    if anchor not in anchors:
        known = ", ".join(anchors)
        raise ReplyParseError(f"action {index} is relative to {anchor}, expected one of {known}", row)
    numbers = tuple(map(int, texts))
    if max(numbers[3:6]) >= ROTATION_BINS:
        message = f"action {index} has the rotations {list(numbers[3:6])}, expected 0 to {ROTATION_BINS - 1}"
        raise ReplyParseError(message, row)
    return anchor, numbers


def anchor_text(anchor: Anchor, objects: Sequence[ObjectPose], order: Order) -> str:
    """An anchor of a scene as its rows write it."""
    if not anchor.object_name:
        return anchor.frame
    lettered = anchor.named({pose.name: letter(place) for place, pose in enumerate(in_order(objects, order))})
    return f"{lettered.object_name} {lettered.frame}{lettered.others_text}"


def letter(place: int) -> str:
    """The letter of an object, by its index: A to Z, then AA, AB, ..."""
    first, last = divmod(place, len(LETTERS))
    return (LETTERS[first - 1] if first else "") + LETTERS[last]
