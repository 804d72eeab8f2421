"""The paper's representation: each action is seven bins in the world frame (section III-C and III-D)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from app.pipeline.episode import Demonstration, EndEffectorAction, ObjectPose
from app.pipeline.representation.base import row_count_bounds
from app.pipeline.representation.lists import Column, list_grammar, list_rows, list_schema, row_integers
from app.pipeline.workspace import (
    POSITION_BINS,
    ROTATION_BINS,
    Workspace,
    discretize_actions,
    object_bins,
    undiscretize_actions,
)

_COLUMNS = (
    *(Column(name, 0, POSITION_BINS - 1) for name in ("x", "y", "z")),
    *(Column(name, 0, ROTATION_BINS - 1) for name in ("roll", "pitch", "yaw")),
    Column("gripper", 0, 1),
)
_ROW_RULES = """row ::= "[" p ", " p ", " p ", " r ", " r ", " r ", " [01] "]"
p ::= [0-9] | [1-9] [0-9]
r ::= [0-9] | [1-6] [0-9] | "7" [01]
"""


@dataclass(frozen=True, eq=False)
class AbsoluteCodec:
    """``{'drawer': [42, 65, 29], 'open the drawer'}>[[46, 74, 55, 54, 36, 37, 1], ...], ``.

    Attributes:
        with_instruction: whether the observation ends with the instruction (`paper`) or not (`authors`).
    """

    workspace: Workspace
    demonstrations: tuple[Demonstration, ...]
    with_instruction: bool
    stop: tuple[str, ...] = ("{'",)  # the next observation
    separator: str = ", "

    @classmethod
    def fit(cls, demonstrations: Sequence[Demonstration], workspace: Workspace, with_instruction: bool) -> Self:
        """The codec for `demonstrations`: of them it only needs the number of rows."""
        return cls(workspace, tuple(demonstrations), with_instruction)

    def questions(self, instruction: str) -> tuple[str, ...]:
        return (instruction,)

    def observation_text(self, objects: Sequence[ObjectPose], instruction: str) -> str:
        parts = [f"'{pose.name}': {list(object_bins(pose, self.workspace))}" for pose in objects]
        if self.with_instruction:
            parts.append(f"'{instruction}'")
        return "{" + ", ".join(parts) + "}>"

    def actions_text(self, demonstration: Demonstration) -> str:
        return str([list(item.bins) for item in discretize_actions(demonstration.actions, self.workspace)])

    def demonstration_text(self, demonstration: Demonstration) -> str:
        observation = self.observation_text(demonstration.objects, demonstration.instruction)
        return f"{observation}{self.actions_text(demonstration)}{self.separator}"

    def grammar(self, instruction: str, max_actions: int) -> str:
        return list_grammar(_ROW_RULES, *row_count_bounds(self.demonstrations, instruction, max_actions))

    def schema(self, instruction: str, max_actions: int) -> Mapping[str, object]:
        return list_schema(_COLUMNS, *row_count_bounds(self.demonstrations, instruction, max_actions))

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        return list_rows(reply_text, complete)

    def reply_text(self, rows: Sequence[str]) -> str:
        return f"[{', '.join(rows)}]"

    def decode_rows(
        self,
        first: int,
        rows: Sequence[str],
        objects: Sequence[ObjectPose],
        instruction: str,
        start: EndEffectorAction | None = None,
    ) -> list[EndEffectorAction]:
        bins = [row_integers(row, index, _COLUMNS) for index, row in enumerate(rows, start=first)]
        return undiscretize_actions(bins, self.workspace)
