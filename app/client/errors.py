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
    """The service did not answer: wrong address, not started, gone, or too slow."""
