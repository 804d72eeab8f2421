"""What a use case can refuse beyond the method's and the store's own errors; a branch of `app.pipeline.errors`."""

from datetime import datetime

from app.pipeline.errors import ReplyParseError, UnsupportedActionError
from roboprompt_client.errors import RoboPromptError, UnsafeActionError


class ServiceError(RoboPromptError):
    """A use case cannot go on.

    ├── ExpiredKeyError         the key was right and has expired
    ├── NoDemonstrationsError   the task has no episode yet
    └── RefusedReplyError       what the LLM replied is recorded, and not passed on
        ├── UnparsableReplyError    it is not a list of valid actions
        ├── UnsafeReplyError        one of its actions is beyond a bound of motion
        └── UnsupportedReplyError   one of its actions is unlike what was demonstrated
    """


class ExpiredKeyError(ServiceError):
    """The key was right and has expired.

    Args:
        name: of the key.
        expired_at: when.
    """

    def __init__(self, name: str, expired_at: datetime) -> None:
        super().__init__(f"the key {name!r} expired at {expired_at:%Y-%m-%d %H:%M} UTC")


class NoDemonstrationsError(ServiceError):
    """The task has no episode yet, or leaves all out of prompts, so that there is nothing to learn from."""

    def __init__(self, task: str) -> None:
        super().__init__(
            f"task {task!r} has no demonstrations: upload some with POST /episodes, or show those that are left out"
        )


class RefusedReplyError(ServiceError):
    """What an LLM replied is not passed on.

    Args:
        reply_text: as the LLM gave it.
        prediction_id: under which the reply is recorded.
    """

    def __init__(self, message: str, reply_text: str, prediction_id: str) -> None:
        super().__init__(message)
        self.reply_text = reply_text
        self.prediction_id = prediction_id


class UnparsableReplyError(RefusedReplyError):
    """The LLM's reply is not a list of valid actions: `error` says why."""

    def __init__(self, error: ReplyParseError, reply_text: str, prediction_id: str) -> None:
        super().__init__(error.message, reply_text, prediction_id)


class UnsafeReplyError(RefusedReplyError):
    """The LLM's reply asks for an action beyond a bound of motion: `action` says which and why."""

    def __init__(self, action: UnsafeActionError, reply_text: str, prediction_id: str) -> None:
        super().__init__(str(action), reply_text, prediction_id)
        self.action = action


class UnsupportedReplyError(RefusedReplyError):
    """The LLM's reply asks for an action that the demonstrations do not support: `action` says which and why."""

    def __init__(self, action: UnsupportedActionError, reply_text: str, prediction_id: str) -> None:
        super().__init__(str(action), reply_text, prediction_id)
        self.action = action
