"""A task's bounds of motion: those that hold at this moment, and what the audit log says of a change.

They may have been tightened while an LLM was writing.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import anyio.to_thread
from sqlalchemy import Connection

from app.services.cache import Cache
from app.services.predict.question import Question
from app.services.task_settings import TaskSettings
from app.store import audit, tasks
from app.store.store import Store
from roboprompt_client.motion_guard import MotionGuard
from roboprompt_client.motion_limits import MotionLimits
from roboprompt_client.trajectory import EndEffectorAction

CAPACITY = 64
BOUNDS = ("workspace", "motion_limits")  # settings that decide which actions are unsafe


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
        return MotionGuard(limits, self._question.request.options.max_actions, self._question.end_effector)


def record_limits(
    connection: Connection,
    task: str,
    before: Mapping[str, Any],
    after: Mapping[str, Any],
    *,
    action: str = "limits.changed",
    actor: str | None = None,
) -> None:
    """Add an entry if the settings' bounds differ.

    Args:
        before, after: settings, as JSON.
    """
    changed = [name for name in BOUNDS if before.get(name) != after.get(name)]
    if changed:
        details = {when: {name: values.get(name) for name in changed} for when, values in _both(before, after)}
        audit.record(connection, action, task, details, actor)


def _both(before: Mapping[str, Any], after: Mapping[str, Any]) -> tuple[tuple[str, Mapping[str, Any]], ...]:
    return ("before", before), ("after", after)
