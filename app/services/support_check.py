"""The actions of one reply against what its demonstrations support."""

from collections.abc import Sequence

from app.pipeline.episode import EndEffectorAction
from app.pipeline.errors import UnsupportedActionError
from app.pipeline.findings import Finding
from app.pipeline.plans.support import PlacedRow, SupportGuard
from app.services.question import Question


class SupportCheck:
    """Checks actions as they come.

    Attributes:
        finding: the first action that the demonstrations do not support, where the request lets it pass.

    Args:
        num_before: actions of replies to earlier parts of the instruction.
    """

    def __init__(self, question: Question, instruction: str, num_before: int = 0) -> None:
        plans = question.plans.get(instruction)
        self._guard = SupportGuard(plans, num_before) if plans else None
        self._allows = question.request.unsupported == "allow"
        self.finding: Finding | None = None

    def check(self, actions: Sequence[EndEffectorAction]) -> list[PlacedRow | None]:
        """Let the next actions pass; the demonstrated row that each carries out, None where none is known.

        Raises:
            UnsupportedActionError: unless the request lets it pass.
        """
        return [self._row(action) for action in actions]

    def _row(self, action: EndEffectorAction) -> PlacedRow | None:
        try:
            return None if self._guard is None else self._guard.check(action)
        except UnsupportedActionError as error:
            self._let_pass(error)
            return None

    def finish(self) -> None:
        """Let the reply end; raises as `check`."""
        try:
            if self._guard is not None:
                self._guard.finish()
        except UnsupportedActionError as error:
            self._let_pass(error)

    def _let_pass(self, error: UnsupportedActionError) -> None:
        if not self._allows:
            raise error
        self._guard = None
        self.finding = Finding("unsupported-action", "danger", f"{error}.", error.field)
