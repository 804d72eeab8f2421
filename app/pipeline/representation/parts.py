"""Words instead of numbers: a reply names parts that demonstrations show, each with an object to carry it out at.

::

    Objects: green block
    At white plate: red block
    Instruction: build a tower 2 high on the white plate
    Steps:
    1. grasp green block
    2. release 2 white plate

Each part stands for actions relative to an object, as several demonstrations have them; the service places them in the
scene. A prompt has a third of the tokens of other representations and a reply a tenth, and a model that reads may put
parts together as no demonstration does. Of the scene's numbers it reads one thing: which object is at which.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from typing import ClassVar

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.order.order import Order
from app.pipeline.representation.base import Codec, Decoder, clause_by_clause
from app.pipeline.representation.common_parts import CommonParts, find_parts
from app.pipeline.representation.part import Part, SceneState, kind_of
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

NEAR_M, LOWER_M = 0.10, 0.005  # an object is at a lower one of another kind that is so near, seen from above
_TO = "(?:at|in|into|on|onto|to)"  # before the name of where things go
_STEP = re.compile(r"(\d{1,3})\. (.+)", re.ASCII)


@dataclass(frozen=True, eq=False)
class PartsCodec(Codec):
    """Demonstrations as steps, fitted to those of one prompt."""

    demonstrations: tuple[Demonstration, ...]
    common: CommonParts
    with_instruction: bool
    stop: ClassVar[tuple[str, ...]] = ("\n\n",)
    separator: ClassVar[str] = "\n\n"
    joint: ClassVar[str] = "\n"

    @classmethod
    def fit(cls, demonstrations: Sequence[Demonstration], with_instruction: bool) -> "PartsCodec":
        """Find the parts.

        Raises:
            InvalidInputError: if no demonstration consists of parts that others have, too, or if demonstrations that
                read alike have different steps: then what decides between them is not in the text.
        """
        codec = cls(tuple(demonstrations), find_parts(demonstrations), with_instruction)
        needed = codec.needed()
        if not needed:
            message = "is 'parts', but no demonstration consists of parts that others have at objects of the same kind"
            raise InvalidInputError("representation", message, "absolute, object_frame")
        steps = {codec.observation_text(item): codec.actions_text(item) for item in needed}
        if any(steps[codec.observation_text(item)] != codec.actions_text(item) for item in needed):
            message = "is 'parts', but demonstrations that read alike have different steps: no words say which to take"
            raise InvalidInputError("representation", message, "absolute, object_frame")
        return codec

    def needed(self) -> tuple[Demonstration, ...]:
        return tuple(item for item, steps in zip(self.demonstrations, self.common.steps, strict=True) if steps)

    def questions(self, order: Order) -> tuple[str, ...]:
        return clause_by_clause(self.demonstrations, order)

    def observation_text(self, query: Query) -> str:
        said = in_sequence(each_named(query), query.order.names)
        instruction = f"Instruction: {said}\n" if self.with_instruction else ""
        return f"{_scene_text(replace(query, instruction=said).ordered_objects)}{instruction}Steps:"

    def actions_text(self, demonstration: Demonstration) -> str:
        steps = self.common.steps[self.demonstrations.index(demonstration)] or ()
        return "\n".join(f"{number}. {step}" for number, step in enumerate(steps, 1))

    def grammar(self, query: Query, max_actions: int) -> str:
        steps = " | ".join(f'"{step}"' for step in self.steps(query))
        most = max(1, max_actions // min(len(part.actions) for part in self.common.parts))
        return f'root ::= "\\n"? step ("\\n" step){{0,{most - 1}}} "\\n\\n"?\nstep ::= [1-9] [0-9]? ". " ({steps})\n'

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        lines = [line.strip() for line in reply_text.strip("\n").split("\n")]
        return lines if complete else lines[:-1]

    def reply_text(self, rows: Sequence[str]) -> str:
        return "\n" + "\n".join(rows)

    def decoder(self, query: Query) -> Decoder:
        return _Placer(self, query)

    def steps(self, query: Query) -> dict[str, tuple[Part, str]]:
        """Return every step that a reply may have, by its text: each part at each object of its kind."""
        return {
            part.text(pose.name): (part, pose.name)
            for part in self.common.parts
            for pose in query.ordered_objects
            if kind_of(pose.name) == part.kind
            and (pose.quaternion_xyzw is not None or all(action.spot.code == "w" for action in part.actions))
        }


class _Placer:
    """Reads the steps of a reply in their order, and places each in the scene that the steps before it leave."""

    def __init__(self, codec: PartsCodec, query: Query) -> None:
        self._observed, self._steps = query, codec.steps(query)
        self._scenes = [SceneState(query.objects)]  # before each step that was read, and after the last

    def __call__(self, first: int, rows: Sequence[str]) -> list[EndEffectorAction]:
        actions: list[EndEffectorAction] = []
        del self._scenes[first + 1 :]
        for index, row in enumerate(rows, first):
            (part, name), scene = self._read(index, row), self._scenes[-1]
            if scene.hand is None and part.actions[0].spot.keeps:
                raise ReplyParseError(f"step {index} is {row[:80]!r}, but the hand holds nothing before", row)
            placed = list(part.placed(name, scene, self._observed))
            self._scenes.append(reduce(SceneState.after, placed, scene))
            actions += placed
        return actions

    def _read(self, index: int, row: str) -> tuple[Part, str]:
        match = _STEP.fullmatch(row)
        if not match or int(match[1]) != index + 1:
            raise ReplyParseError(f"step {index} is {row[:80]!r}, expected '{index + 1}. PART OBJECT'", row)
        if match[2] not in self._steps:
            valid = ", ".join(self._steps)
            raise ReplyParseError(f"step {index} is {match[2][:80]!r}, expected one of {valid}", row)
        return self._steps[match[2]]


def _scene_text(objects: Sequence[ObjectPose]) -> str:
    host = {pose.name: _host(pose, objects) for pose in objects}
    hosts = [name for name in host if name in host.values()]
    alone = [name for name in host if host[name] is None and name not in hosts]
    lines = {"Objects": alone} | {f"At {name}": [other for other in host if host[other] == name] for name in hosts}
    return "".join(f"{where}: {', '.join(names)}\n" for where, names in lines.items() if names)


def _host(pose: ObjectPose, others: Sequence[ObjectPose]) -> str | None:
    away_m = {
        other.name: float(np.linalg.norm((other.position_m - pose.position_m)[:2]))
        for other in others
        if kind_of(other.name) != kind_of(pose.name) and other.position_m[2] < pose.position_m[2] - LOWER_M
    }
    nearest = min(away_m, key=away_m.__getitem__, default=None)
    return nearest if nearest is not None and away_m[nearest] <= NEAR_M else None


def each_named(query: Query) -> str:
    """Return "put every red block in the tray" with a list of the red blocks, without those that are at the tray."""
    words = [pose.name.split() for pose in query.objects]
    kinds = {" ".join(name[k:]) for name in words for k in range(len(name))}
    every = rf"\b(?:every|each) ({'|'.join(map(re.escape, sorted(kinds, key=len, reverse=True)))})\b"
    goals = [
        name for name in query.order.objects if re.search(rf"\b{_TO} (?:the )?{re.escape(name)}\b", query.instruction)
    ]

    def listed(match: re.Match[str]) -> str:
        group = [pose for pose in query.objects if f" {pose.name}".endswith(f" {match[1]}")]
        names = [f"the {pose.name}" for pose in group if _host(pose, query.objects) not in goals]
        return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part) or match[0]

    return re.sub(every, listed, query.instruction)


def in_sequence(text: str, names: Sequence[str]) -> str:
    """Return "press A after B" and "press B before A" as "press B, then A": in the order of execution.

    Other instructions stay as they are, also those in which such a word has more than the name of an object beside it.
    """
    mentions = Order(text, tuple(names)).mentions
    between = {text[one.end : other.start].removesuffix("the ") for one, other in pairwise(mentions)}
    if between not in ({" before "}, {" after "}):
        return text
    said = [mention.name for mention in mentions]
    first, *later = said if between == {" before "} else said[::-1]
    head, tail = text[: mentions[0].start], text[mentions[-1].end :]
    return f"{head}{first}{''.join(f', then the {name}' for name in later)}{tail}"
