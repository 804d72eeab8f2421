"""The present limits of motion, which every action of a reply must keep."""

from collections.abc import Sequence

import anyio.to_thread
from sqlalchemy import Connection

from app.services.predict.known import KnownReader
from app.services.predict.question import Question
from roboprompt_client.motion.guard import MotionGuard
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.types.poses import EndEffectorAction


class MotionCheck:
    """Checks the actions of one answer by the limits of the moment, which may change while an LLM writes.

    Each method raises UnsafeActionError for an action beyond a limit.
    """

    def __init__(self, read: KnownReader, question: Question) -> None:
        self._read, self._question = read, question
        self._actions: list[EndEffectorAction] = []

    async def check(self, actions: Sequence[EndEffectorAction] = ()) -> None:
        """Check the actions so far, and these that come next."""
        self._actions += actions
        self._check(await anyio.to_thread.run_sync(self._read.present_limits, self._question.request.task))

    def within(self, connection: Connection) -> None:
        """Check the actions so far in a transaction."""
        self._check(self._read.limits(connection, self._question.request.task))

    def _check(self, limits: MotionLimits) -> None:
        guard = MotionGuard(limits, self._question.max_actions, self._question.request.end_effector)
        for action in self._actions:
            guard.check(action)
