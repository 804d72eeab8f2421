"""The actions of one reply against what its demonstrations support."""

from collections.abc import Sequence

from app.pipeline.action_findings import ActionDoubt
from app.pipeline.episode import EndEffectorAction
from app.pipeline.errors import UnsupportedActionError
from app.pipeline.plans.support import PlacedRow, SupportGuard
from app.pipeline.workspace import ROTATION_BIN_DEG
from app.services.question import Question

# What bins alone may do: half a bin where a demonstration was written, half where the reply is read; of rotations,
# three Euler angles together.
TOLERATED_BINS = 1.0
TOLERATED_DEG = 1.5 * ROTATION_BIN_DEG


class SupportCheck:
    """Checks actions as they come.

    Attributes:
        doubts: about actions that the request lets pass, and about those that lie beyond every demonstration.

    Args:
        num_before: actions of replies to earlier parts of the instruction.
    """

    def __init__(self, question: Question, instruction: str, num_before: int = 0) -> None:
        plans = question.plans.get(instruction)
        self._guard = SupportGuard(plans, num_before) if plans else None
        self._allows = question.request.unsupported == "allow"
        self._tolerated_m = TOLERATED_BINS * float(question.settings.workspace.workspace().bin_size_m.max())
        self._index = num_before
        self.doubts: list[ActionDoubt] = []

    def check(self, actions: Sequence[EndEffectorAction]) -> list[PlacedRow | None]:
        """Let the next actions pass; the demonstrated row that each carries out, None where none is known.

        Raises:
            UnsupportedActionError: unless the request lets it pass.
        """
        return [self._row(action) for action in actions]

    def _row(self, action: EndEffectorAction) -> PlacedRow | None:
        index, self._index = self._index, self._index + 1
        if self._guard is None:
            return None
        try:
            row = self._guard.check(action)
        except UnsupportedActionError as error:
            self._let_pass(error, index)
            self._guard.pass_by()
            return None
        self._doubt(index, row, action)
        return row

    def _doubt(self, index: int, row: PlacedRow, action: EndEffectorAction) -> None:
        beyond_m, beyond_deg = row.beyond(action)
        if beyond_m > self._tolerated_m or beyond_deg > TOLERATED_DEG:
            seen_from = row.anchor.object_name or f"the {row.anchor.frame}"
            self.doubts.append(ActionDoubt(index, beyond_m, beyond_deg, seen_from))

    def finish(self) -> None:
        """Let the reply end; raises as `check`."""
        try:
            if self._guard is not None:
                self._guard.finish()
        except UnsupportedActionError as error:
            self._let_pass(error, self._index)

    def _let_pass(self, error: UnsupportedActionError, index: int) -> None:
        if not self._allows:
            raise error
        self.doubts.append(ActionDoubt(index, unsupported=error))
