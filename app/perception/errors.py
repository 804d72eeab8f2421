"""What can go wrong with a pose estimator that is not the caller's doing."""

from app.pipeline.errors import RoboPromptError


class PoseServerError(RoboPromptError):
    """A server that was to find objects did not.

    ├── PoseServerUnavailableError  it cannot be reached, or says that it is not ready
    ├── PoseServerTimeoutError      no answer within the object model's timeout_s
    └── PoseServerReplyError        it answered with an error or with something unintelligible
    """


class PoseServerUnavailableError(PoseServerError):
    """It cannot be reached, or says that it is not ready."""


class PoseServerTimeoutError(PoseServerError):
    """No answer within the object model's timeout_s."""


class PoseServerReplyError(PoseServerError):
    """It answered with an error or with something unintelligible."""
