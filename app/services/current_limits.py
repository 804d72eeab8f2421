"""The bounds of motion that hold at this moment: they may have been tightened while an LLM was writing."""

from collections.abc import Sequence

import anyio.to_thread
from sqlalchemy import Connection

from app.pipeline.episode import EndEffectorAction
from app.pipeline.motion_guard import MotionGuard
from app.pipeline.motion_limits import MotionLimits
from app.services.cache import Cache
from app.services.question import Question
from app.services.task_settings import TaskSettings
from app.store import tasks
from app.store.store import Store

CAPACITY = 64


class CurrentLimits:
    """Reads tasks' limits; one whose version is as it was costs the read of that number."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._built: Cache[tuple[str, int], MotionLimits] = Cache(CAPACITY)

    def read(self, connection: Connection, task: str) -> MotionLimits:
        """The task's limits.

        Raises:
            NotFoundError: if there is no such task.
        """

        def build() -> MotionLimits:
            return TaskSettings.model_validate(tasks.get(connection, task).settings).limits_of_motion()

        return self._built.get((task, tasks.version(connection, task)), build)

    async def now(self, task: str) -> MotionLimits:
        """The same on a connection of its own, in a thread."""

        def read() -> MotionLimits:
            with self._store.read() as connection:
                return self.read(connection, task)

        return await anyio.to_thread.run_sync(read)


class ActionCheck:
    """Holds the actions of one answer against the limits of the moment; where those changed, all of them again.

    Each method raises UnsafeActionError for an action beyond a limit.
    """

    def __init__(self, current: CurrentLimits, question: Question) -> None:
        self._current, self._question = current, question
        self._actions: list[EndEffectorAction] = []
        self._limits = question.settings.limits_of_motion()
        self._guard = self._guarding(self._limits)

    async def arrived(self, actions: Sequence[EndEffectorAction]) -> None:
        """Let the answer's next actions pass."""
        await self.again()
        for action in actions:
            self._guard.check(action)
            self._actions.append(action)

    async def again(self) -> None:
        """Check the actions so far, just before one of them is sent."""
        self._hold(await self._current.now(self._question.request.task))

    def within(self, connection: Connection) -> None:
        """The same in a transaction."""
        self._hold(self._current.read(connection, self._question.request.task))

    def _hold(self, limits: MotionLimits) -> None:
        if limits == self._limits:
            return
        guard = self._guarding(limits)
        for action in self._actions:
            guard.check(action)
        self._limits, self._guard = limits, guard

    def _guarding(self, limits: MotionLimits) -> MotionGuard:
        return MotionGuard(limits, self._question.request.max_actions, self._question.end_effector)
