"""Errors of use cases, beside those of the method (`app.pipeline.errors`) and of the store."""

from app.pipeline.errors import ReplyParseError, UnsupportedActionError
from roboprompt_client.errors import RoboPromptError, UnsafeActionError

RefusedReply = ReplyParseError | UnsafeActionError | UnsupportedActionError


class NoDemonstrationsError(RoboPromptError):
    """The task has no episode yet, or leaves all out of prompts, so that there is nothing to learn from."""

    def __init__(self, task: str) -> None:
        super().__init__(
            f"task {task!r} has no demonstrations: upload some with POST /episodes, or show those that are left out"
        )


class RefusedReplyError(RoboPromptError):
    """An LLM's reply is recorded, and not passed on.

    Args:
        cause: the error of the reply: it cannot be parsed, breaks a limit of motion, or is not supported.
        reply_text: as the LLM gave it.
        prediction_id: under which the reply is recorded.
    """

    def __init__(self, cause: RefusedReply, reply_text: str, prediction_id: str) -> None:
        super().__init__(str(cause))
        self.cause = cause
        self.reply_text = reply_text
        self.prediction_id = prediction_id
