"""Errors that end an evaluation or a trial."""

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


class LedgerInUseError(EvaluationError):
    """Another run writes into the same file."""


class LedgerDamagedError(EvaluationError):
    """A line that no run has written."""


class UnknownWorldError(EvaluationError):
    """A world that is not there, or whose environment is missing."""
