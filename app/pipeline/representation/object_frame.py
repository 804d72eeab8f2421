"""Our representation, beyond the paper: each action relative to the object it has to do with.

``red button 40 41 17 36; push the red button > 1 red button w: +0 +0 +14 0 36 36 0; 2 ...``

A row has its number, an object, one of two frames at the object's position (`w`: world axes, `o`: axes turned with the
object), the offset in units of 5 mm, the relative rotation in 72 bins and the gripper. A reply is decoded against the
CONTINUOUS observed pose, so that the object's own binning costs nothing.
"""

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration, EndEffectorAction, ObjectPose
from app.pipeline.errors import ReplyParseError
from app.pipeline.geometry import yaw_rad
from app.pipeline.language import template
from app.pipeline.representation.anchors import (
    FRAMES,
    Anchor,
    choose_anchors,
    in_order,
    object_rotation,
    relative_action,
    tilted_objects,
)
from app.pipeline.representation.base import row_count_bounds
from app.pipeline.workspace import ROTATION_BINS, Workspace, position_bins, rotation_bins, rotation_from_bins, yaw_bin

Integers = npt.NDArray[np.int_]

OFFSET_UNIT_M = 0.005
# Integers that differ by no more than this over the demonstrations are made equal: small models copy them better.
JITTER_UNITS = 1
_ROW = re.compile(
    r"(\d{1,3}) (.+) ([wo]): ([+-]\d{1,3}) ([+-]\d{1,3}) ([+-]\d{1,3}) (\d{1,2}) (\d{1,2}) (\d{1,2}) ([01])", re.ASCII
)
_FENCE = re.compile(r"^```\w*\n?|```$")
_GRAMMAR_TAIL = """b ::= d " " d " " d " " r " " r " " r " " [01]
d ::= [+-] ([0-9] | [1-9] [0-9] | [1-9] [0-9] [0-9])
r ::= [0-9] | [1-6] [0-9] | "7" [01]
"""


@dataclass(frozen=True)
class _Row:
    """One action in integers: the anchor, six numbers (offset in units, rotation bins) and the gripper."""

    anchor: Anchor
    numbers: tuple[int, ...]
    gripper_open: bool


@dataclass(frozen=True, eq=False)
class ObjectFrameCodec:
    """Actions relative to objects, fitted to the demonstrations of one prompt.

    For each row the (object, frame) pair is the one whose relative action spreads least over the demonstrations whose
    instructions ask for the same (up to the objects they name).

    Attributes:
        tilted: objects whose frame `o` is their full rotation rather than their yaw.
    """

    workspace: Workspace
    demonstrations: tuple[Demonstration, ...]
    with_instruction: bool
    tilted: frozenset[str]
    table: dict[int, tuple[_Row, ...]]
    stop: tuple[str, ...] = ("\n",)

    @classmethod
    def fit(
        cls, demonstrations: Sequence[Demonstration], workspace: Workspace, with_instruction: bool
    ) -> "ObjectFrameCodec":
        """Choose each row's anchor and make equal what differs by rounding only."""
        tilted = tilted_objects(demonstrations)
        groups: dict[tuple[str, int], list[Demonstration]] = defaultdict(list)
        for demonstration in demonstrations:
            names = [pose.name for pose in demonstration.objects]
            groups[template(names, demonstration.instruction), len(demonstration.actions)].append(demonstration)
        table: dict[int, tuple[_Row, ...]] = {}
        for group in groups.values():
            for demonstration, rows in zip(group, _fit_rows(group, tilted), strict=True):
                table[id(demonstration)] = rows
        return cls(workspace, tuple(demonstrations), with_instruction, tilted, table)

    def observation_text(self, objects: Sequence[ObjectPose], instruction: str) -> str:
        parts = [self._object_text(pose) for pose in in_order(objects, instruction)]
        if self.with_instruction:
            parts.append(instruction.rstrip("."))
        return "; ".join(parts) + " >"

    def _object_text(self, pose: ObjectPose) -> str:
        numbers: tuple[int, ...] = position_bins(pose.position_m, self.workspace)
        if pose.quaternion_xyzw is not None:
            rotation = Rotation.from_quat(pose.quaternion_xyzw)
            numbers += rotation_bins(rotation) if pose.name in self.tilted else (yaw_bin(yaw_rad(rotation)),)
        return " ".join([pose.name, *map(str, numbers)])

    def actions_text(self, demonstration: Demonstration) -> str:
        rows = self.table[id(demonstration)]
        return "; ".join(_row_text(number, row) for number, row in enumerate(rows, start=1))

    def demonstration_text(self, demonstration: Demonstration) -> str:
        observation = self.observation_text(demonstration.objects, demonstration.instruction)
        return f"{observation} {self.actions_text(demonstration)}\n"

    def grammar(self, instruction: str, max_actions: int) -> str:
        fewest, most = row_count_bounds(self.demonstrations, instruction, max_actions)
        rows = [f'"{number} " a ": " b' for number in range(1, most + 1)]
        optional = ""
        for row in reversed(rows[fewest:]):
            optional = f' ("; " {row}{optional})?'
        anchors = " | ".join(f'"{name} {frame}"' for name, frame in self._anchors())
        required = ' "; " '.join(rows[:fewest])
        return f'root ::= " " {required}{optional} "\\n"\na ::= {anchors}\n{_GRAMMAR_TAIL}'

    def _anchors(self) -> list[Anchor]:
        """Every (object, frame) that the demonstrations' objects allow."""
        rotated = {pose.name for d in self.demonstrations for pose in d.objects if _has_rotation(pose)}
        names = [pose.name for pose in self.demonstrations[0].objects]
        return [Anchor(name, frame) for name in names for frame in FRAMES if frame == "w" or name in rotated]

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        rows = [row.strip() for row in _FENCE.sub("", reply_text.strip()).split(";")]
        return rows if complete else rows[:-1]

    def decode_row(self, index: int, row: str, objects: Sequence[ObjectPose]) -> EndEffectorAction:
        match = _ROW.fullmatch(row)
        if not match:
            expected = f"'{index + 1} OBJECT w: +x +y +z roll pitch yaw gripper'"
            raise ReplyParseError(f"action {index} is {row[:80]!r}, expected {expected}", row)
        number, name, frame, *numbers, gripper = match.groups()
        if int(number) != index + 1:
            raise ReplyParseError(f"action {index} has row number {number}, expected {index + 1}", row)
        pose = next((pose for pose in objects if pose.name == name), None)
        if pose is None or (frame == "o" and not _has_rotation(pose)):
            known = ", ".join(f"{pose.name} w" + (" or o" if _has_rotation(pose) else "") for pose in objects)
            raise ReplyParseError(f"action {index} is relative to {name!r} {frame}, expected one of {known}", row)
        integers = [int(value) for value in numbers]
        if max(integers[3:]) >= ROTATION_BINS:
            message = f"action {index} has the rotations {integers[3:]}, expected 0 to {ROTATION_BINS - 1}"
            raise ReplyParseError(message, row)
        axes = object_rotation(pose, frame, self.tilted)
        position_m = pose.position_m + axes.apply(np.array(integers[:3]) * OFFSET_UNIT_M)
        rotation = axes * rotation_from_bins(integers[3:])
        return EndEffectorAction(position_m, rotation.as_quat(canonical=True), gripper == "1")


def _has_rotation(pose: ObjectPose) -> bool:
    return pose.quaternion_xyzw is not None


def _fit_rows(group: Sequence[Demonstration], tilted: frozenset[str]) -> list[tuple[_Row, ...]]:
    """The rows of each demonstration of a group that asks for the same thing in the same number of actions."""
    fitted: list[list[_Row]] = [[] for _ in group]
    for k, anchors in enumerate(choose_anchors(group, tilted)):
        numbers = np.array([_integers(d, k, anchor, tilted) for d, anchor in zip(group, anchors, strict=True)])
        for rows, demonstration, anchor, values in zip(fitted, group, anchors, _calmed(numbers), strict=True):
            rows.append(_Row(anchor, tuple(values.tolist()), demonstration.actions[k].gripper_open))
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


def _row_text(number: int, row: _Row) -> str:
    name, frame = row.anchor
    offset = " ".join(f"{value:+d}" for value in row.numbers[:3])
    rotation = " ".join(map(str, row.numbers[3:]))
    return f"{number} {name} {frame}: {offset} {rotation} {int(row.gripper_open)}"
