"""Words instead of numbers: a reply names parts that demonstrations show, each with an object to carry it out at.

::

    Objects: white plate, red block near white plate, green block
    Instruction: build a tower 2 high on the white plate
    Steps:
    1. grasp green block
    2. release 2 white plate

Each part stands for actions relative to an object, as several demonstrations have them; the service places them in the
scene. A prompt has a third of the tokens of other representations and a reply a tenth, and a model that reads may put
parts together as no demonstration does. It cannot follow the scene's numbers: it reads what is near what.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.order.order import Order
from app.pipeline.representation.anchors import Anchor, anchor_pose, tilted_objects
from app.pipeline.representation.base import Codec, Decoder, clause_by_clause
from app.pipeline.representation.common_parts import Part, Step, find_steps, kind_of
from app.pipeline.representation.object_rows import actions_at
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

NEAR_M = 0.10  # beside each other, seen from above; of other kinds: on, in or at it
_STEP = re.compile(r"(\d{1,3})\. (.+)", re.ASCII)


@dataclass(frozen=True, eq=False)
class PartsCodec(Codec):
    """Demonstrations as steps, fitted to those of one prompt.

    Attributes:
        steps: of each demonstration; None where it has actions that too few others have.
        tilted: objects whose frame `o` is their full rotation.
    """

    demonstrations: tuple[Demonstration, ...]
    steps: tuple[tuple[Step, ...] | None, ...]
    tilted: frozenset[str]
    with_instruction: bool
    stop: tuple[str, ...] = ("\n\n",)
    separator: str = "\n\n"
    joint: ClassVar[str] = "\n"

    @classmethod
    def fit(cls, demonstrations: Sequence[Demonstration], with_instruction: bool) -> "PartsCodec":
        """Find the parts.

        Raises:
            InvalidInputError: if no demonstration consists of parts that others have, too.
        """
        tilted = tilted_objects(demonstrations)
        steps = find_steps(demonstrations, tilted)
        if not any(steps):
            message = "is 'parts', but no demonstration consists of parts that others have at objects of the same kind"
            raise InvalidInputError("representation", message, "absolute, object_frame")
        return cls(tuple(demonstrations), tuple(steps), tilted, with_instruction)

    @property
    def parts(self) -> tuple[Part, ...]:
        """In the order in which they first occur."""
        return tuple(dict.fromkeys(step.part for steps in self.steps for step in steps or ()))

    def needed(self) -> tuple[Demonstration, ...]:
        return tuple(item for item, steps in zip(self.demonstrations, self.steps, strict=True) if steps)

    def questions(self, order: Order) -> tuple[str, ...]:
        return clause_by_clause(self.demonstrations, order)

    def observation_text(self, query: Query) -> str:
        objects = ", ".join(_object_text(pose, query.objects) for pose in query.ordered_objects)
        instruction = f"Instruction: {query.instruction}\n" if self.with_instruction else ""
        return f"Objects: {objects}\n{instruction}Steps:"

    def actions_text(self, demonstration: Demonstration) -> str:
        steps = self.steps[self.demonstrations.index(demonstration)] or ()
        return "\n".join(f"{number}. {step.text}" for number, step in enumerate(steps, 1))

    def grammar(self, query: Query, max_actions: int) -> str:
        steps = " | ".join(f'"{step.text}"' for step in self._possible(query))
        most = max(1, max_actions // min(len(part.rows) for part in self.parts))
        return f'root ::= "\\n"? step ("\\n" step){{0,{most - 1}}} "\\n\\n"?\nstep ::= [1-9] [0-9]? ". " ({steps})\n'

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        lines = [line.strip() for line in reply_text.strip("\n").split("\n")]
        return lines if complete else lines[:-1]

    def reply_text(self, rows: Sequence[str]) -> str:
        return "\n" + "\n".join(rows)

    def decoder(self, query: Query) -> Decoder:
        return partial(self._actions, query, {step.text: step for step in self._possible(query)})

    def _possible(self, query: Query) -> list[Step]:
        """Each part at each object of its kind."""
        return [
            Step(part, pose.name)
            for part in self.parts
            for pose in query.ordered_objects
            if kind_of(pose.name) == part.kind
            and (pose.quaternion_xyzw is not None or all(row.frame == "w" for row in part.rows))
        ]

    def _actions(
        self, query: Query, possible: dict[str, Step], first: int, rows: Sequence[str]
    ) -> list[EndEffectorAction]:
        return [
            action
            for index, row in enumerate(rows, first)
            for action in _placed(_read(index, row, possible), query, self.tilted)
        ]


def _object_text(pose: ObjectPose, others: Sequence[ObjectPose]) -> str:
    """Its name, and the nearest object of another kind, if that is near."""
    away_m = {
        other.name: float(np.linalg.norm((other.position_m - pose.position_m)[:2]))
        for other in others
        if kind_of(other.name) != kind_of(pose.name)
    }
    nearest = min(away_m, key=away_m.__getitem__, default="")
    return f"{pose.name} near {nearest}" if nearest and away_m[nearest] <= NEAR_M else pose.name


def _read(index: int, row: str, possible: dict[str, Step]) -> Step:
    match = _STEP.fullmatch(row)
    if not match or int(match[1]) != index + 1:
        raise ReplyParseError(f"step {index} is {row[:80]!r}, expected '{index + 1}. PART OBJECT'", row)
    if match[2] not in possible:
        raise ReplyParseError(f"step {index} is {match[2][:80]!r}, expected one of {', '.join(possible)}", row)
    return possible[match[2]]


def _placed(step: Step, query: Query, tilted: frozenset[str]) -> list[EndEffectorAction]:
    """The step's actions in the scene."""
    rows = step.part.rows
    anchored = [anchor_pose(Anchor(step.object_name, row.frame), query, tilted) for row in rows]
    numbers = np.array([row.numbers for row in rows])
    return actions_at(anchored, numbers, [row.gripper_open for row in rows])
