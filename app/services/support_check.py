"""The actions of one reply against what its demonstrations support."""

from collections.abc import Sequence

from app.pipeline.episode import EndEffectorAction
from app.pipeline.errors import UnsupportedActionError
from app.pipeline.findings import Finding
from app.pipeline.plans.support import SupportGuard
from app.services.question import Question


class SupportCheck:
    """Checks actions as they come.

    Attributes:
        finding: the first action that the demonstrations do not support, where the request lets it pass.
    """

    def __init__(self, question: Question, instruction: str) -> None:
        support = question.template.support
        plans = None if support is None else support.placed(question.objects, instruction, question.start)
        self._guard = SupportGuard(plans) if plans else None
        self._allows = question.request.unsupported == "allow"
        self.finding: Finding | None = None

    def check(self, actions: Sequence[EndEffectorAction]) -> None:
        """Let the next actions pass.

        Raises:
            UnsupportedActionError: unless the request lets it pass.
        """
        try:
            for action in actions:
                if self._guard is not None:
                    self._guard.check(action)
        except UnsupportedActionError as error:
            self._let_pass(error)

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
