"""What keeps an evaluation from going on.

EvaluationError
├── ServerStartError     the service did not come up; ends with what it wrote last
├── ServiceLostError     the service does not answer any more
├── ExpertFailedError    a task's expert fails too often to teach the task
├── NotLearnedError      objects of a task cannot be found in images
├── OtherModelError      the results that are there were made with another default model
├── BudgetSpentError     the next trial may exceed the budget
├── NotConfirmedError    nobody agreed to the estimated cost
├── LedgerInUseError     another run writes into the same results
├── LedgerDamagedError   a line of the results that no run has written
└── RayMissingError      Ray is not installed
"""

from roboprompt_client.errors import RoboPromptError


class EvaluationError(RoboPromptError):
    """Base of what an evaluation raises on purpose."""


class ServerStartError(EvaluationError):
    """The service did not come up; the message ends with what it wrote last."""


class ServiceLostError(EvaluationError):
    """The service does not answer any more."""


class ExpertFailedError(EvaluationError):
    """A task's expert fails too often to teach the task."""


class NotLearnedError(EvaluationError):
    """Objects of a task cannot be found in images; the message says which and why."""


class OtherModelError(EvaluationError):
    """The results that are there were made with another default model."""


class BudgetSpentError(EvaluationError):
    """The next trial may exceed the budget; says what is spent."""


class NotConfirmedError(EvaluationError):
    """Nobody agreed to the estimated cost; nothing was asked."""


class LedgerInUseError(EvaluationError):
    """Another run writes into the same file."""


class LedgerDamagedError(EvaluationError):
    """A line that no run has written."""


class RayMissingError(EvaluationError):
    """Ray is not installed."""
