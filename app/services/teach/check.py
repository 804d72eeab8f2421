"""A task's demonstrations held against each other before a robot moves: what they share, and each left out."""

import threading
from dataclasses import dataclass

import anyio
import anyio.to_thread

from app.pipeline.finding import Finding
from app.pipeline.skill.skills import Skills
from app.services.predict.known import KnownReader
from app.store import episodes


@dataclass(frozen=True, eq=False)
class CheckedTask:
    """The result of a check.

    Attributes:
        num_episodes: that prompts may show; of more than 50 those are checked whose scenes lie farthest apart.
        findings: as every upload and prediction has them.
    """

    task: str
    num_episodes: int
    skills: Skills
    findings: tuple[Finding, ...]


class CheckTask:
    """Checks a task's demonstrations."""

    def __init__(self, known: KnownReader) -> None:
        self._known = known
        self._threads = anyio.CapacityLimiter(1)  # what waits for its turn takes no thread from others
        self._one_at_a_time = threading.Lock()  # a page that is reloaded must not work the same out twice

    async def __call__(self, task: str) -> CheckedTask:
        """Return the check of a task.

        Raises:
            NotFoundError: if there is no such task.
            NoDemonstrationsError: if it has no episode.
            InvalidInputError: naming an episode that cannot be extracted with the task's settings.
        """
        return await anyio.to_thread.run_sync(self._checked, task, limiter=self._threads)

    def _checked(self, name: str) -> CheckedTask:
        with self._one_at_a_time, self._known.reading(name) as task:
            number = episodes.number_of(task.connection, name, left_out=False)
            return CheckedTask(name, number, task.skills, task.doubts)
