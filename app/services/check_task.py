"""A task's demonstrations, each predicted from the others before a robot moves; by an LLM where one is named."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import anyio.to_thread

from app.llm.base import ModelProfile
from app.perception.base import ObjectQuery
from app.pipeline.check import Checked, check_demonstrations
from app.pipeline.check.replies import ReplyCheck, check_reply, reply_findings
from app.pipeline.check.report import TaskCheck
from app.pipeline.episode import Demonstration
from app.pipeline.errors import InvalidInputError
from app.pipeline.findings import Finding
from app.pipeline.motion_limits import Pose
from app.services.cache import Cache
from app.services.demonstrations import recordings_of
from app.services.errors import NoDemonstrationsError, UnparsableReplyError, UnsafeReplyError, UnsupportedReplyError
from app.services.predict_actions import PredictActions
from app.services.question import PredictRequest
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.store import Store

MOST_CHECKED = 30  # demonstrations, the task's first, as prompts have them unless a request selects others
KEPT = 32  # checks of task versions
REFUSALS = (UnparsableReplyError, UnsafeReplyError, UnsupportedReplyError, InvalidInputError)


@dataclass(frozen=True)
class CheckedTask:
    """What a check found.

    Attributes:
        num_episodes: that the task has; a check takes the first `MOST_CHECKED`.
        model: that was asked for what each demonstration does; None if none was.
        replies: of each demonstration; empty without a model.
    """

    task: str
    num_episodes: int
    check: TaskCheck
    model: str | None = None
    replies: tuple[ReplyCheck, ...] = ()
    reply_findings: tuple[Finding, ...] = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All of them, causes first."""
        return (*self.check.findings, *self.reply_findings)
