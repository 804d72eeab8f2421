"""Our representation, beyond the paper: each action relative to the object it has to do with.

``A red button 40 41 17 36; push the red button > 1 A w: +0 +0 +14 0 36 36 0; 2 A w: +0 +0 +2 0; ...``

Objects stand in the order in which the instruction mentions them, each with a letter. A row has its number, the frame
that it follows (`frame_text`), the offset in units of 5 mm, the relative rotation in 72 bins and the gripper. A
rotation with the numbers of the row before is left out. Rows of demonstrations that ask for the same thing of other
objects are then the same. A reply is decoded against the CONTINUOUS observed pose, so that the object's own binning
costs nothing. A row of a reply that demonstrations have, too, stands for its mean, others for the middle of their bins.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import ClassVar

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.order.order import Order
from app.pipeline.representation.base import Codec, Decoder, clause_by_clause
from app.pipeline.representation.frame_text import CODES, FrameParts, frame_text
from app.pipeline.representation.object_grammar import any_rows_grammar, plans_grammar
from app.pipeline.representation.object_rows import (
    RelativePose,
    TextRow,
    actions_at,
    in_full,
    letter,
    letters_of,
    read_row,
    row_text,
    shortened,
)
from app.pipeline.skill.frames import LEANS_RAD, Frame
from app.pipeline.skill.rows import Row
from app.pipeline.skill.scene import WORLD, Scene, Source
from app.pipeline.skill.shown import Shown
from app.pipeline.workspace import Workspace, object_bins, yaw_bin
from roboprompt_client.types import quaternions
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

# So many demonstrations with the same rows are written; further ones would be read at every start and say nothing new.
MAX_REPEATED = 3
MAX_GRAMMARS = 32
RowKey = tuple[int, str, tuple[int, ...]]  # its index, the text of its frame, and its numbers
Means = Mapping[RowKey, RelativePose]
_FENCE = re.compile(r"^```\w*\n?|```$")


@dataclass(frozen=True, eq=False)
class ObjectFrameCodec(Codec):
    """Actions relative to objects, by the rows of skills.

    Attributes:
        tilted: objects whose frame `o` is their full rotation rather than their yaw.
        table: the rows of each demonstration.
    """

    workspace: Workspace
    demonstrations: tuple[Demonstration, ...]
    with_instruction: bool
    tilted: frozenset[str]
    table: tuple[tuple[TextRow, ...], ...]
    stop: ClassVar[tuple[str, ...]] = ("\n",)
    separator: ClassVar[str] = "\n"
    joint: ClassVar[str] = " "

    @classmethod
    def of(cls, shown: Sequence[Shown], workspace: Workspace, with_instruction: bool) -> "ObjectFrameCodec":
        """Write the rows of demonstrations."""
        demonstrations = tuple(item.demonstration for item in shown)
        rows: dict[Row, TextRow] = {row: TextRow(row) for item in shown for row in item.rows}
        table = tuple(tuple(rows[row] for row in item.rows) for item in shown)
        return cls(workspace, demonstrations, with_instruction, tilted_objects(demonstrations), table)

    def questions(self, order: Order) -> tuple[str, ...]:
        return clause_by_clause(self.demonstrations, order)

    def observation_text(self, query: Query) -> str:
        ordered = enumerate(query.ordered_objects)
        parts = [f"{letter(place)} {self._object_text(pose)}" for place, pose in ordered]
        if self.with_instruction:
            parts.append(query.instruction.rstrip("."))
        return "; ".join(parts) + " >"

    def _object_text(self, pose: ObjectPose) -> str:
        numbers = object_bins(pose, self.workspace)
        if pose.quaternion_xyzw is not None and pose.name not in self.tilted:
            numbers = (*numbers[:3], yaw_bin(quaternions.yaw_rad(pose.quaternion_xyzw)))
        return " ".join([pose.name, *map(str, numbers)])

    def actions_text(self, demonstration: Demonstration) -> str:
        rows, letters = self.table[self.demonstrations.index(demonstration)], letters_of(demonstration)
        frames = [FrameParts.of(row.frame).text(letters) for row in rows]
        numbered = enumerate(zip(rows, frames, strict=True), start=1)
        return "; ".join(shortened([row_text(number, frame, row) for number, (row, frame) in numbered]))

    def needed(self) -> tuple[Demonstration, ...]:
        """The last few of the demonstrations that ask for the same thing and have the same rows.

        Where rows differ, all are needed: they show how often each variant occurs, and in which scenes.
        """
        needed: set[int] = set()
        forms = [item.order.form for item in self.demonstrations]
        for form in dict.fromkeys(forms):
            places = [place for place, own in enumerate(forms) if own == form]
            texts = {self.actions_text(self.demonstrations[place]) for place in places}
            needed.update(places[-MAX_REPEATED:] if len(texts) == 1 else places)
        return tuple(self.demonstrations[place] for place in sorted(needed))

    def grammar(self, query: Query, max_actions: int) -> str:
        return self._grammars(query.order, max_actions)

    @cached_property
    def _grammars(self) -> Callable[[Order, int], str]:
        """Grammars of the last orders: to write one takes as long as to read a reply."""
        return lru_cache(maxsize=MAX_GRAMMARS)(self._grammar)

    def _grammar(self, asked: Order, max_actions: int) -> str:
        plans = [(item.order, rows) for item, rows in zip(self.demonstrations, self.table, strict=True)]
        query = Query(asked.text, self.demonstrations[0].objects)
        of_plans = plans_grammar(plans, letters_of(query), asked, max_actions)
        return of_plans or any_rows_grammar(self.demonstrations, list(self._frames(query)), asked, max_actions)

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        rows = [row.strip() for row in _FENCE.sub("", reply_text.strip()).split(";")]
        return in_full(rows if complete else rows[:-1])

    def reply_text(self, rows: Sequence[str]) -> str:
        return f" {'; '.join(shortened(rows))}"

    def decoder(self, query: Query) -> Decoder:
        frames = {
            text: frame
            for text, frame in self._frames(query).items()
            if query.start is not None or not frame.needs_start
        }
        return partial(self._actions, Scene.of(query), frames, self._means(query))

    @cached_property
    def _shown(self) -> tuple[Frame, ...]:
        return tuple(dict.fromkeys(row.frame for rows in self.table for row in rows))

    @cached_property
    def _codes(self) -> tuple[str, ...]:
        """The codes that a row may have at an object; mixed ones only if some demonstration has them."""
        shown = {parts.code for parts in map(FrameParts.of, self._shown) if not parts.toward}
        return tuple(code for code in CODES if len(code) == 1 or code in shown)

    def _frames(self, query: Query) -> dict[str, Frame]:
        """The frames that a row may have, by their texts."""
        letters, found = letters_of(query), {}
        for pose in query.ordered_objects:
            key = query.order.placeholder(pose.name)
            at, own = Source("object", key), Source("leaning" if pose.name in self.tilted else "object", key)
            for code in self._codes if pose.quaternion_xyzw is not None else ("w",):
                axes, hand = (own if c == "o" else WORLD for c in (code[0], code[-1]))
                found[f"{letters[key]} {code}"] = Frame((at, at, at), axes, hand)
        for frame in self._shown:
            if (text := frame_text(frame, letters)) is not None and _is_turned(frame, query):
                found[text] = frame
        return found

    def _actions(
        self, scene: Scene, frames: Mapping[str, Frame], means: Means, first: int, rows: Sequence[str]
    ) -> list[EndEffectorAction]:
        if not rows:
            return []
        read = [(index, *read_row(index, row, frames)) for index, row in enumerate(rows, start=first)]
        poses = [
            means.get((index, text, numbers[:6])) or RelativePose.of_numbers(numbers[:6])
            for index, text, numbers in read
        ]
        return actions_at([frames[text] for _, text, _ in read], poses, [row[2][6] == 1 for row in read], scene)

    def _means(self, query: Query) -> Means:
        """The demonstrated poses that rows of a reply stand for."""
        letters, means = letters_of(query), {}
        for item, rows in zip(self.demonstrations, self.table, strict=True):
            for index, row in enumerate(rows if item.order.form == query.order.form else ()):
                if (text := frame_text(row.frame, letters)) is not None:
                    means[index, text, row.numbers] = row.mean
        return means


def tilted_objects(scenes: Sequence[Query]) -> frozenset[str]:
    """Return the names of objects that mostly lean: their whole rotation turns a hand, not their yaw."""
    tilts_rad: dict[str, list[float]] = {}
    for scene in scenes:
        for pose in scene.objects:
            if pose.quaternion_xyzw is not None:
                tilts_rad.setdefault(pose.name, []).append(quaternions.tilt_rad(pose.quaternion_xyzw))
    return frozenset(name for name, found in tilts_rad.items() if np.median(found) > LEANS_RAD)


def _is_turned(frame: Frame, query: Query) -> bool:
    """Return whether the rotations are known that a frame depends on."""
    turning = {source.one for source in (frame.axes, frame.hand) if source.kind in ("object", "leaning")}
    known = {query.order.placeholder(pose.name) for pose in query.objects if pose.quaternion_xyzw is not None}
    return turning <= known
