"""The paper's rows with each number that follows an object written as a sum: what a small model misses is written out.

::

    {'drawer': [60,51,6,36,36,18] a(+0 +11 +6), 'open the drawer'}>open the drawer
    [1 drawer a +0 +11 +6: [60+0=60,51+11=62,6+6=12,0,29,18+0=18,1]; 2 drawer +0 +0 +0: [60+0=60,51+0=51,...]]

(on one line). The reply repeats the instruction first: small models then read which object it names. A row has the
object that it follows, the difference to that in bins, and the paper's seven bins. Those that follow the object are
sums, of which the results count; a yaw may leave 0..71 and is read modulo 72. A difference that turns with the object,
or that binning changes from scene to scene, is a step: it has a letter, and the observation lists it beside the object.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.groups import places_by
from app.pipeline.order.order import Order
from app.pipeline.representation.absolute import AbsoluteCodec, Column, row_integers
from app.pipeline.representation.anchors import START, WORLD, Anchor, Frame, anchor_pose
from app.pipeline.representation.base import Codec, Decoder, row_count_bounds
from app.pipeline.representation.object_frame import ObjectFrameCodec
from app.pipeline.representation.object_rows import Row, actions_at, letter
from app.pipeline.workspace import (
    ROTATION_BINS,
    Workspace,
    discretize_actions,
    object_bins,
    undiscretize_actions,
)
from roboprompt_client.types.poses import EndEffectorAction

NO_TURN = ROTATION_BINS // 2  # the bin of an angle of 0
_ROW = re.compile(r"[^\];]+\]")
_WHOLE_ROW = r"[^\[\];]+: \[[^\[\]]*\]"
_REPLY = re.compile(rf"[^\n]*\[{_WHOLE_ROW}(?:; {_WHOLE_ROW})*\]\s*")
_ADDENDS = re.compile(r"\d+[+-]\d+=")
_RULES = """step ::= " " [a-z] [a-z]?
d ::= " " [+-] p
s ::= p ([+-] p "=" p)?
t ::= r ([+-] p "=" "-"? ("1"? [0-9] [0-9] | [0-9]))?
p ::= [0-9] | [1-9] [0-9]
r ::= [0-9] | [1-6] [0-9] | "7" [01]
"""


class Step(NamedTuple):
    """What a row does at an object, in whichever scene and whatever the object's name.

    Attributes:
        form: of the instruction.
        role: place of the object in the instruction, or the name of one that it does not mention.
        numbers: of the row, relative to the object in `frame`.
    """

    form: str
    role: int | str
    frame: Frame
    numbers: tuple[int, ...]

    @classmethod
    def of(cls, demonstration: Demonstration, row: Row) -> "Step":
        """The step of a demonstration's row."""
        order, name = demonstration.order, row.anchor.object_name
        role = order.objects.index(name) if name in order.objects else name
        return cls(order.form, role, row.anchor.frame, row.numbers)

    def anchor(self, order: Order) -> Anchor:
        """What it is relative to where `order`, which has its form, is carried out."""
        return Anchor(order.objects[self.role] if isinstance(self.role, int) else self.role, self.frame)


@dataclass(frozen=True, eq=False)
class SumsCodec(Codec):
    """Absolute rows as sums, fitted to the demonstrations of one prompt.

    Attributes:
        fitted: the demonstrations relative to objects: what each row follows, and at what difference.
        letters: of the steps that observations list.
    """

    workspace: Workspace
    fitted: ObjectFrameCodec
    letters: dict[Step, str]
    stop: tuple[str, ...] = ("\n",)
    separator: str = "\n"
    columns: ClassVar[Sequence[Column]] = (
        *AbsoluteCodec.columns[:5],
        Column("yaw", -NO_TURN, ROTATION_BINS + NO_TURN - 1),
        AbsoluteCodec.columns[6],
    )

    @classmethod
    def fit(cls, demonstrations: Sequence[Demonstration], workspace: Workspace) -> "SumsCodec":
        """Find what each row follows, and the steps."""
        codec = cls(workspace, ObjectFrameCodec.fit(demonstrations, workspace, with_instruction=True), {})
        for places in places_by(demonstrations, lambda item: item.kind).values():
            for step in codec._steps_of(places):
                codec.letters.setdefault(step, letter(len(codec.letters)).lower())
        return codec

    def _steps_of(self, places: Sequence[int]) -> Iterator[Step]:
        """Yield the steps of demonstrations of one kind: the rows that all have, but at differences that vary."""
        shown = [self.fitted.demonstrations[place] for place in places]
        for rows in zip(*(self.fitted.table[place] for place in places), strict=True):
            anchor, steps = rows[0].anchor, set(map(Step.of, shown, rows))
            if anchor.frame == "world" or len(steps) > 1:
                continue
            turns = anchor.place_turns and any(rows[0].numbers[:2])
            tilts = anchor.hand_turns and anchor.object_name in self.fitted.tilted
            apart = {self._difference(item, row.anchor, row.numbers) for item, row in zip(shown, rows, strict=True)}
            if turns or tilts or len(apart) > 1:
                yield steps.pop()

    def needed(self) -> tuple[Demonstration, ...]:
        return self.fitted.needed()

    def questions(self, order: Order) -> tuple[str, ...]:
        return self.fitted.questions(order)

    def observation_text(self, query: Query) -> str:
        parts = [
            f"'{name}': [{','.join(map(str, bins))}]{self._steps_text(query, name)}"
            for name, bins in self._origins(query).items()
        ]
        return "{" + ", ".join([*parts, f"'{query.instruction}'"]) + "}>"

    def _steps_text(self, query: Query, name: str) -> str:
        """The steps at an object (or the start) in this scene."""
        texts = []
        for step, letter_ in self.letters.items():
            if step.form != query.order.form:
                continue
            anchor = step.anchor(query.order)
            if _name(anchor) == name:
                numbers = [f"{value:+d}" for value in self._difference(query, anchor, step.numbers)]
                if anchor.object_name in self.fitted.tilted:
                    numbers += map(str, self._placed(query, anchor, step.numbers)[3:])
                texts.append(f" {letter_}({' '.join(numbers)})")
        return "".join(texts)

    def actions_text(self, demonstration: Demonstration) -> str:
        rows = self.fitted.table[self.fitted.demonstrations.index(demonstration)]
        texts = [f"{number} {self._row_text(demonstration, row)}" for number, row in enumerate(rows, start=1)]
        return f"{demonstration.instruction} [{'; '.join(texts)}]"

    def _row_text(self, demonstration: Demonstration, row: Row) -> str:
        anchor, bins = row.anchor, self._placed(demonstration, row.anchor, row.numbers)
        cells, head = list(map(str, bins)), _name(anchor)
        if step := self.letters.get(Step.of(demonstration, row)):
            head += f" {step}"
        if anchor != WORLD:
            origin = self._origins(demonstration)[_name(anchor)]
            differences = [f"{bins[k] - origin[k]:+d}" for k in range(3)]
            head += " " + " ".join(differences)
            cells[:3] = [_sum(origin[k], bins[k] - origin[k]) for k in range(3)]
            if anchor.hand_turns and anchor.object_name not in self.fitted.tilted:
                cells[5] = _sum(origin[5], row.numbers[5] - NO_TURN)
        return f"{head}: [{','.join([*cells, str(int(row.gripper_open))])}]"

    @cached_property
    def _anchors(self) -> frozenset[Anchor]:
        """Those of the demonstrations' rows."""
        return frozenset(row.anchor for rows in self.fitted.table for row in rows)

    def _origins(self, query: Query) -> dict[str, tuple[int, ...]]:
        """The bins of everything that a row may follow, by name: of objects, and of the start where rows follow it."""
        origins = {pose.name: object_bins(pose, self.workspace) for pose in query.objects}
        if query.start is not None and START in self._anchors:
            origins[START.frame] = discretize_actions([query.start], self.workspace)[0].bins[:6]
        return origins

    def _placed(self, query: Query, anchor: Anchor, numbers: tuple[int, ...]) -> tuple[int, ...]:
        """The six bins of a row in a scene."""
        pose = anchor_pose(anchor, query, self.fitted.tilted)
        actions = actions_at([pose], np.array([numbers]), [True])
        return discretize_actions(actions, self.workspace)[0].bins[:6]

    def _difference(self, query: Query, anchor: Anchor, numbers: tuple[int, ...]) -> tuple[int, ...]:
        """Its position bins less those of what it follows."""
        origin = self._origins(query)[_name(anchor)]
        return tuple(at - start for at, start in zip(self._placed(query, anchor, numbers)[:3], origin[:3], strict=True))

    def grammar(self, query: Query, max_actions: int) -> str:
        fewest, most = row_count_bounds(self.fitted.demonstrations, query.order, max_actions)
        followed = (*self._origins(query), *([WORLD.frame] if WORLD in self._anchors else []))
        names = " | ".join(f'"{name}"' for name in followed)
        said = re.sub(r'(["\\])', r"\\\1", query.instruction)
        cells = ' "," '.join("sssrrt")
        return (
            f'root ::= "{said} [" row ("; " row){{{fewest - 1},{most - 1}}} "]"\n'
            f'row ::= [1-9] [0-9]{{0,2}} " " ({names}) step? (d d d)? ": [" {cells} "," [01] "]"\n{_RULES}'
        )

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        """The rows; the first has what stands before it, so that `reply_text` gives it back."""
        if complete and not _REPLY.fullmatch(reply_text):
            raise ReplyParseError("the reply is not one list '[drawer: [60+0=60, ...]; ...]'", reply_text)
        return [row.strip() for row in _ROW.findall(reply_text)]

    def reply_text(self, rows: Sequence[str]) -> str:
        return f"{'; '.join(rows)}]"

    def decoder(self, query: Query) -> Decoder:
        return self._actions

    def _actions(self, first: int, rows: Sequence[str]) -> list[EndEffectorAction]:
        bins = [
            row_integers(_ADDENDS.sub("", row[row.rindex("[") :]), index, self.columns)
            for index, row in enumerate(rows, start=first)
        ]
        return undiscretize_actions([(*row[:5], row[5] % ROTATION_BINS, row[6]) for row in bins], self.workspace)


def _sum(number: int, difference: int) -> str:
    return f"{number}{difference:+d}={number + difference}"


def _name(anchor: Anchor) -> str:
    """What rows call it."""
    return anchor.object_name or anchor.frame
