"""`object_frame` where the demonstrations are of other tasks than the one that is asked for.

Rows name roles, not objects: A is what the instruction mentions first, in each task another thing. So rows of one task
can be read in the scene of another. Each task's rows are fitted among its own demonstrations; nothing says which of
them fit the new scene, so that a reply may follow any of its objects in any number of rows that some task has.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.pipeline.episode import Demonstration, Query
from app.pipeline.order.order import Order
from app.pipeline.representation.anchors import tilted_objects
from app.pipeline.representation.base import Decoder
from app.pipeline.representation.object_frame import ObjectFrameCodec
from app.pipeline.representation.object_grammar import any_rows_grammar
from app.pipeline.workspace import Workspace


@dataclass(frozen=True, eq=False)
class OtherTasksCodec:
    """The demonstrations of several tasks, to ask about scenes that none of them shows.

    Attributes:
        seen: fitted to the demonstrations of a task each.
    """

    seen: tuple[ObjectFrameCodec, ...]
    stop: tuple[str, ...] = ("\n",)
    separator: str = "\n"

    @classmethod
    def fit(
        cls, tasks: Sequence[Sequence[Demonstration]], workspace: Workspace, with_instruction: bool
    ) -> "OtherTasksCodec":
        """Fit the rows of each task among its demonstrations."""
        return cls(tuple(ObjectFrameCodec.fit(shown, workspace, with_instruction) for shown in tasks))

    def needed(self) -> tuple[Demonstration, ...]:
        return tuple(demonstration for codec in self.seen for demonstration in codec.needed())

    def questions(self, order: Order) -> tuple[str, ...]:
        """Clause by clause where every demonstration of every task carries out a single one."""
        return min((codec.questions(order) for codec in self.seen), key=len)

    def observation_text(self, query: Query) -> str:
        return self._asking(query).observation_text(query)

    def actions_text(self, demonstration: Demonstration) -> str:
        return self._of(demonstration).actions_text(demonstration)

    def demonstration_text(self, demonstration: Demonstration) -> str:
        return self._of(demonstration).demonstration_text(demonstration)

    def schema(self, query: Query, max_actions: int) -> None:
        """Its rows are no JSON."""

    def grammar(self, query: Query, max_actions: int) -> str:
        shown = [demonstration for codec in self.seen for demonstration in codec.demonstrations]
        return any_rows_grammar(shown, query.order, 1, max_actions, (query,))

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        return self.seen[0].rows(reply_text, complete)

    def reply_text(self, rows: Sequence[str]) -> str:
        return self.seen[0].reply_text(rows)

    def decoder(self, query: Query) -> Decoder:
        return self._asking(query).decoder(query)

    def _of(self, demonstration: Demonstration) -> ObjectFrameCodec:
        return next(codec for codec in self.seen if demonstration in codec.demonstrations)

    def _asking(self, query: Query) -> ObjectFrameCodec:
        """How the new scene is written and its rows are read; which objects are tilted, it shows itself."""
        table = tuple(rows for codec in self.seen for rows in codec.table)
        return replace(self.seen[0], tilted=tilted_objects([query]), table=table)
