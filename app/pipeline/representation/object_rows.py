"""The rows of `object_frame`: those of skills, written as text, and read from replies."""

import re
import string
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.representation.frame_text import PATTERN
from app.pipeline.skill.frames import Frame
from app.pipeline.skill.rows import Row, posed
from app.pipeline.skill.scene import Scene
from app.pipeline.workspace import ROTATION_BINS, rotation_bins, rotation_from_bins
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

LETTERS = string.ascii_uppercase
OFFSET_UNIT_M = 0.005
_ROW = re.compile(
    rf"(\d{{1,3}}) ({PATTERN}):"
    r" ([+-]\d{1,3}) ([+-]\d{1,3}) ([+-]\d{1,3}) (\d{1,2}) (\d{1,2}) (\d{1,2}) ([01])",
    re.ASCII,
)
_OFFSET = r"(?P<offset>[^:]*:(?: [+-]\d{1,3}){3})"
_ROTATION = re.compile(rf"{_OFFSET}(?P<rotation>(?: \d{{1,2}}){{3}})(?P<gripper> [01])", re.ASCII)
_NO_ROTATION = re.compile(rf"{_OFFSET}(?P<gripper> [01])", re.ASCII)


class RelativePose(NamedTuple):
    """A pose of the hand as a frame sees it: offset (3,) in meters, and rotation (4,)."""

    offset_m: Array
    rotation_xyzw: Array

    @classmethod
    def of_numbers(cls, numbers: Sequence[int]) -> "RelativePose":
        """The pose that six numbers of a row stand for by themselves."""
        return cls(OFFSET_UNIT_M * np.array(numbers[:3], dtype=float), rotation_from_bins(numbers[3:]).as_quat())


@dataclass(frozen=True, eq=False)
class TextRow:
    """A row of a skill in integers.

    Attributes:
        frame: of which rows write the text.
        numbers: of its mean: the offset in units, and three rotation bins.
    """

    row: Row

    @property
    def frame(self) -> Frame:
        return self.row.frame

    @property
    def gripper_open(self) -> bool:
        return self.row.gripper_open

    @property
    def mean(self) -> RelativePose:
        """The pose that its numbers stand for."""
        return RelativePose(self.row.place, self.row.turn)

    @cached_property
    def numbers(self) -> tuple[int, ...]:
        offset = np.rint(self.row.place / OFFSET_UNIT_M).astype(int).tolist()
        return (*offset, *rotation_bins(Rotation.from_quat(self.row.turn[None]))[0].tolist())


def actions_at(
    frames: Sequence[Frame], poses: Sequence[RelativePose], grippers: Sequence[bool], scene: Scene
) -> list[EndEffectorAction]:
    """The actions of rows in a scene: of each its frame, and the pose of the hand as that sees it."""
    offsets_m, rotations = map(np.array, zip(*poses, strict=True))
    positions_m, hands = posed(frames, offsets_m, rotations, scene)
    return EndEffectorAction.many(positions_m, Rotation.from_quat(hands).as_quat(canonical=True), grippers)


def letters_of(query: Query) -> dict[str, str]:
    """The letters of a scene's objects, by their keys in frames: in the order in which words mention them."""
    ordered = enumerate(query.ordered_objects)
    return {query.order.placeholder(pose.name): letter(place) for place, pose in ordered}


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


def letter(place: int) -> str:
    """The letter of an object, by its index: A to Z, then AA, AB, ..."""
    first, last = divmod(place, len(LETTERS))
    return (LETTERS[first - 1] if first else "") + LETTERS[last]
