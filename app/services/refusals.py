"""What a use case can refuse beyond the method's and the store's own errors; a branch of `app.pipeline.errors`."""

from app.pipeline.errors import RoboPromptError, UnsafeActionError, UnsupportedActionError


class ServiceError(RoboPromptError):
    """A use case cannot go on.

    ├── NoDemonstrationsError   the task has no episode yet
    ├── UnparsableReplyError    the LLM's reply is not a list of valid actions; recorded
    ├── UnsafeReplyError        one of its actions is beyond a bound of motion; recorded
    └── UnsupportedReplyError   one of its actions is unlike what was demonstrated; recorded
    """


class NoDemonstrationsError(ServiceError):
    """The task has no episode yet, so that there is nothing to learn from."""

    def __init__(self, task: str) -> None:
        super().__init__(f"task {task!r} has no demonstrations yet: upload some with POST /episodes")


class UnparsableReplyError(ServiceError):
    """The LLM's reply is not a list of valid actions.

    Args:
        reply_text: as the LLM gave it.
        prediction_id: under which the reply is recorded.
    """

    def __init__(self, message: str, reply_text: str, prediction_id: str) -> None:
        super().__init__(message)
        self.reply_text = reply_text
        self.prediction_id = prediction_id


class UnsafeReplyError(ServiceError):
    """The LLM's reply asks for an action beyond a bound of motion.

    Args:
        action: what is wrong with which action.
        reply_text, prediction_id: as in UnparsableReplyError.
    """

    def __init__(self, action: UnsafeActionError, reply_text: str, prediction_id: str) -> None:
        super().__init__(str(action))
        self.action = action
        self.reply_text = reply_text
        self.prediction_id = prediction_id


class UnsupportedReplyError(ServiceError):
    """The LLM's reply asks for an action that the demonstrations do not support.

    Args:
        action: what is wrong with which action.
        reply_text, prediction_id: as in UnparsableReplyError.
    """

    def __init__(self, action: UnsupportedActionError, reply_text: str, prediction_id: str) -> None:
        super().__init__(str(action))
        self.action = action
        self.reply_text = reply_text
        self.prediction_id = prediction_id
