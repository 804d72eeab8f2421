"""`object_frame` where the demonstrations are of other tasks than the one that is asked for.

Rows name roles, not objects: A is what the instruction mentions first, in each task another thing. So rows of one task
can be read in the scene of another. Each task's rows are fitted among its own demonstrations; nothing says which of
them fit the new scene, so that a reply may follow any of its objects in any number of rows that some task has.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.pipeline.episode import Demonstration
from app.pipeline.representation.anchors import tilted_objects
from app.pipeline.representation.object_frame import ObjectFrameCodec
from app.pipeline.representation.object_grammar import any_rows_grammar
from app.pipeline.workspace import Workspace
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose


@dataclass(frozen=True, eq=False)
class OtherTasksCodec:
    """The demonstrations of several tasks, and the scene of one that none of them shows.

    Attributes:
        seen: fitted to the demonstrations of a task each.
        scene: the objects that are asked about; empty before a scene is known (`in_scene`).
    """

    seen: tuple[ObjectFrameCodec, ...]
    scene: tuple[ObjectPose, ...] = ()
    stop: tuple[str, ...] = ("\n",)
    separator: str = "\n"

    @classmethod
    def fit(
        cls, tasks: Sequence[Sequence[Demonstration]], workspace: Workspace, with_instruction: bool
    ) -> "OtherTasksCodec":
        """Fit the rows of each task among its demonstrations."""
        return cls(tuple(ObjectFrameCodec.fit(shown, workspace, with_instruction) for shown in tasks))

    def in_scene(self, objects: Sequence[ObjectPose]) -> "OtherTasksCodec":
        """The same, to ask about a scene."""
        return replace(self, scene=tuple(objects))

    def telling(self) -> tuple[Demonstration, ...]:
        """The demonstrations that a prompt needs, task by task; see `ObjectFrameCodec`."""
        return tuple(demonstration for codec in self.seen for demonstration in codec.telling())

    def questions(self, instruction: str) -> tuple[str, ...]:
        """Clause by clause where every demonstration of every task carries out a single one."""
        return min((codec.questions(instruction) for codec in self.seen), key=len)

    def observation_text(self, objects: Sequence[ObjectPose], instruction: str) -> str:
        return self._asking(objects).observation_text(objects, instruction)

    def actions_text(self, demonstration: Demonstration) -> str:
        return self._of(demonstration).actions_text(demonstration)

    def demonstration_text(self, demonstration: Demonstration) -> str:
        return self._of(demonstration).demonstration_text(demonstration)

    def schema(self, instruction: str, max_actions: int) -> None:
        """Its rows are no JSON."""

    def grammar(self, instruction: str, max_actions: int) -> str:
        shown = [demonstration for codec in self.seen for demonstration in codec.demonstrations]
        return any_rows_grammar(shown, instruction, 1, max_actions, (_unacted(self.scene),))

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        return self.seen[0].rows(reply_text, complete)

    def reply_text(self, rows: Sequence[str]) -> str:
        return self.seen[0].reply_text(rows)

    def decode_rows(
        self,
        first: int,
        rows: Sequence[str],
        objects: Sequence[ObjectPose],
        instruction: str,
        start: EndEffectorAction | None = None,
    ) -> list[EndEffectorAction]:
        return self._asking(objects).decode_rows(first, rows, objects, instruction, start)

    def _of(self, demonstration: Demonstration) -> ObjectFrameCodec:
        return next(codec for codec in self.seen if any(known is demonstration for known in codec.demonstrations))

    def _asking(self, objects: Sequence[ObjectPose]) -> ObjectFrameCodec:
        """How the new scene is written and its rows are read; which objects are tilted, it shows itself."""
        scene, table = _unacted(objects), tuple(rows for codec in self.seen for rows in codec.table)
        return replace(self.seen[0], demonstrations=(scene,), tilted=tilted_objects([scene]), table=table)


def _unacted(objects: Sequence[ObjectPose]) -> Demonstration:
    """A scene in which nothing was demonstrated."""
    return Demonstration("", tuple(objects), ())
