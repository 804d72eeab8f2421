"""What a client of the service can meet."""

from collections.abc import Mapping
from typing import Any


class ServiceProblemError(Exception):
    """The service refused a request or failed.

    Attributes:
        status: the HTTP status.
        problem: the `application/problem+json` document: type, title, detail, errors; for an unparsable reply also
            `reply_text`.
    """

    def __init__(self, status: int, problem: Mapping[str, Any]) -> None:
        super().__init__(f"{status} {problem.get('title', '')}: {problem.get('detail', '')}")
        self.status = status
        self.problem = problem


class ServiceUnreachableError(Exception):
    """The service did not answer: wrong address, not started, gone, or too slow.

    Attributes:
        timed_out: whether it was too slow.
    """

    def __init__(self, message: str, *, timed_out: bool = False) -> None:
        super().__init__(message)
        self.timed_out = timed_out


class ObjectLostError(Exception):
    """An object that an action hangs on cannot be seen any more; the robot was stopped.

    Attributes:
        object_name: which.
    """

    def __init__(self, object_name: str, reason: str) -> None:
        super().__init__(f"{object_name!r} is lost: {reason}")
        self.object_name = object_name


class DangerError(Exception):
    """The service says of its own prediction that it is probably wrong, and nobody allowed it; nothing was moved."""
