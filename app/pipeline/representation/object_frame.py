"""Our representation, beyond the paper: each action relative to the object it has to do with.

``A red button 40 41 17 36; push the red button > 1 A w: +0 +0 +14 0 36 36 0; 2 A w: +0 +0 +2 0; ...``

Objects stand in the order in which the instruction mentions them, each with a letter. A row has its number, an object's
letter, a frame at the object's position (`w`: world axes, `o`: axes turned with the object, `ow`: these for the offset
and the world's for the rotation, `wo`: the reverse), the offset in units of 5 mm, the relative rotation in 72 bins and
the gripper. A rotation with the numbers of the row before is left out. A row that follows no object has `world` or
`start` (where the end effector was at first) instead of letter and frame. Where the hand's place follows something
else along one axis, the row says so: `A w z=world` is at a height of the world, `A w y=B` has B's y. `A ow>B` has axes
at A of which x points to B. Rows of demonstrations that ask for the same thing of other objects are then the same. A
reply is decoded against the CONTINUOUS observed pose, so that the object's own binning costs nothing. A row of a reply
that demonstrations have, too, stands for the mean of the poses that it was written for, others for the middle of their
bins.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from operator import attrgetter
from typing import ClassVar

from app.pipeline.episode import Demonstration, Query
from app.pipeline.groups import made_by_group, places_by
from app.pipeline.order.order import Order
from app.pipeline.representation.anchors import (
    MIXED_FRAMES,
    OBJECT_FRAMES,
    START,
    WORLD,
    Anchor,
    AnchorFrame,
    AnchorPose,
    anchor_pose,
    asked_anchor,
    tilted_objects,
)
from app.pipeline.representation.base import Codec, Decoder, clause_by_clause
from app.pipeline.representation.object_grammar import any_rows_grammar, plans_grammar
from app.pipeline.representation.object_rows import (
    RelativePose,
    Step,
    TextRow,
    actions_at,
    anchor_text,
    fit_rows,
    in_full,
    letter,
    read_row,
    row_text,
    shortened,
)
from app.pipeline.workspace import Workspace, object_bins, yaw_bin
from roboprompt_client.types import quaternions
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

# So many demonstrations with the same rows are written; further ones would be read at every start and say nothing new.
MAX_REPEATED = 3
MAX_GRAMMARS = 32
RowKey = tuple[int, str, tuple[int, ...]]  # its index, anchor and numbers
Means = Mapping[RowKey, RelativePose]
_FENCE = re.compile(r"^```\w*\n?|```$")


@dataclass(frozen=True, eq=False)
class ObjectFrameCodec(Codec):
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
    table: tuple[tuple[TextRow, ...], ...]
    stop: ClassVar[tuple[str, ...]] = ("\n",)
    separator: ClassVar[str] = "\n"
    joint: ClassVar[str] = " "

    @classmethod
    def fit(
        cls, demonstrations: Sequence[Demonstration], workspace: Workspace, with_instruction: bool
    ) -> "ObjectFrameCodec":
        """Choose each row's anchor and make equal what differs by rounding only."""
        tilted = tilted_objects(demonstrations)
        table = made_by_group(demonstrations, attrgetter("kind"), partial(fit_rows, tilted=tilted))
        return cls(workspace, tuple(demonstrations), with_instruction, tilted, table)

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
        rows = self.table[self.demonstrations.index(demonstration)]
        anchors = [anchor_text(row.anchor, demonstration.objects, demonstration.order) for row in rows]
        numbered = enumerate(zip(rows, anchors, strict=True), start=1)
        return "; ".join(shortened([row_text(number, anchor, row) for number, (row, anchor) in numbered]))

    def needed(self) -> tuple[Demonstration, ...]:
        """The last few of the demonstrations that ask for the same thing and have the same rows.

        Where rows differ, all are needed: they show how often each variant occurs, and in which scenes.
        """
        needed: set[int] = set()
        for places in places_by(self.demonstrations, attrgetter("order.form")).values():
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
        of_plans = plans_grammar(self.demonstrations, self.table, asked, max_actions)
        return of_plans or any_rows_grammar(self.demonstrations, self.frames, self._by_axis, asked, max_actions)

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        rows = [row.strip() for row in _FENCE.sub("", reply_text.strip()).split(";")]
        return in_full(rows if complete else rows[:-1])

    def reply_text(self, rows: Sequence[str]) -> str:
        return f" {'; '.join(shortened(rows))}"

    def decoder(self, query: Query) -> Decoder:
        return partial(self._actions, self._anchored(query), self._means(query))

    @cached_property
    def _shown(self) -> frozenset[Anchor]:
        return frozenset(row.anchor for rows in self.table for row in rows)

    @cached_property
    def _by_axis(self) -> frozenset[tuple[Order, Anchor]]:
        pairs = zip(self.demonstrations, self.table, strict=True)
        return frozenset((item.order, row.anchor) for item, rows in pairs for row in rows if row.anchor.is_of_several)

    @cached_property
    def frames(self) -> tuple[AnchorFrame, ...]:
        """The frames that a row may have at an object; mixed ones only if some demonstration has them."""
        shown = {anchor.frame for anchor in self._shown if not anchor.toward}
        return (*OBJECT_FRAMES, *(frame for frame in MIXED_FRAMES if frame in shown))

    def _actions(
        self, anchored: Mapping[str, AnchorPose], means: Means, first: int, rows: Sequence[str]
    ) -> list[EndEffectorAction]:
        if not rows:
            return []
        read = [(index, *read_row(index, row, anchored)) for index, row in enumerate(rows, start=first)]
        poses = [
            means.get((index, anchor, numbers[:6])) or RelativePose.of_numbers(numbers[:6])
            for index, anchor, numbers in read
        ]
        return actions_at([anchored[anchor] for _, anchor, _ in read], poses, [row[2][6] == 1 for row in read])

    def _means(self, query: Query) -> Means:
        """The demonstrated poses that rows of a reply stand for."""
        order = query.order
        return {
            (index, anchor_text(step.row(order).anchor, query.objects, order), step.numbers): mean
            for (index, step), mean in self._steps.items()
            if step.form == order.form
        }

    @cached_property
    def _steps(self) -> Mapping[tuple[int, Step], RelativePose]:
        """The means of what the rows of demonstrations do, each with the row's index."""
        pairs = zip(self.demonstrations, self.table, strict=True)
        rows = ((shown, index, row) for shown, rows in pairs for index, row in enumerate(rows))
        return {(index, Step.of(shown, row)): row.mean for shown, index, row in rows if row.mean is not None}

    def _anchored(self, query: Query) -> dict[str, AnchorPose]:
        ordered = enumerate(query.ordered_objects)
        anchors = {
            f"{letter(place)} {frame}": Anchor(pose.name, frame, tilted=self.tilted)
            for place, pose in ordered
            for frame in self.frames
            if frame == "w" or pose.quaternion_xyzw is not None
        }
        for shown, anchor in self._by_axis:
            asked = asked_anchor(anchor, shown, query.order)
            anchors[anchor_text(asked, query.objects, query.order)] = asked
        for anchor in (WORLD, START):
            if anchor in self._shown and (anchor is WORLD or query.start is not None):
                anchors[anchor.frame] = anchor
        return {text: anchor_pose(anchor, query) for text, anchor in anchors.items()}
