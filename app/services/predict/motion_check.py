"""The present limits of motion, which every action of a reply must keep."""

from collections.abc import Iterable

import anyio.to_thread
from sqlalchemy import Connection

from app.services.predict.known import KnownReader
from app.services.predict.question import Question
from roboprompt_client.errors import UnsafeActionError
from roboprompt_client.motion.guard import MotionGuard
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.types.poses import EndEffectorAction


class MotionCheck:
    """Checks the actions of one answer by the limits of motion, and all of them again where those change.

    They may be tightened while an LLM writes. Each method raises UnsafeActionError for an action beyond a limit.
    """

    def __init__(self, read: KnownReader, question: Question) -> None:
        self._read, self._question = read, question
        self._actions: list[EndEffectorAction] = []
        self._limits = question.known.task.limits
        self._guard = self._guarding(self._limits)

    async def check(self, actions: Iterable[EndEffectorAction]) -> None:
        """Let the answer's next actions pass by the limits that were read last; `again` or `within` follows.

        Where these forbid an action, the present ones decide, which may be wider.
        """
        actions = list(actions)
        self._actions += actions
        try:
            for action in actions:
                self._guard.check(action)
        except UnsafeActionError:
            limits = await self._present()
            if limits == self._limits:
                raise
            self._apply(limits)

    async def again(self) -> None:
        """Check the actions so far by the limits of the moment."""
        self._apply(await self._present())

    def within(self, connection: Connection) -> None:
        self._apply(self._read.limits(connection, self._question.request.task))

    async def _present(self) -> MotionLimits:
        return await anyio.to_thread.run_sync(self._read.present_limits, self._question.request.task)

    def _apply(self, limits: MotionLimits) -> None:
        if limits == self._limits:
            return
        guard = self._guarding(limits)
        for action in self._actions:
            guard.check(action)
        self._limits, self._guard = limits, guard

    def _guarding(self, limits: MotionLimits) -> MotionGuard:
        return MotionGuard(limits, self._question.max_actions, self._question.request.end_effector)
