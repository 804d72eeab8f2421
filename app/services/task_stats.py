"""How robots fared with a task's predictions, by model and configuration."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from app.pipeline.success_rate import SuccessRate
from app.store import predictions, tasks
from app.store.records import ConfigurationCounts
from app.store.store import Store


@dataclass(frozen=True)
class Standing:
    """What became of the predictions of one configuration."""

    counts: ConfigurationCounts

    @property
    def rate(self) -> SuccessRate:
        """Of the predictions whose outcome is known."""
        return SuccessRate(self.counts.successes, self.counts.successes + self.counts.failures)


@dataclass(frozen=True)
class TaskStats:
    """A task's predictions: together, and of each configuration, the surest success first."""

    total: Standing
    configurations: tuple[Standing, ...]


def task_stats(store: Store, task: str) -> TaskStats:
    """The stored outcomes of the task, summed up. Synchronous: call it in a thread.

    Raises:
        NotFoundError: if there is no such task.
    """
    with store.read() as connection:
        tasks.get(connection, task)
        counted = predictions.configuration_counts(connection, task)
    standings = sorted(map(Standing, counted), key=lambda standing: standing.rate.interval[0], reverse=True)
    return TaskStats(Standing(_sum(counted)), tuple(standings))


def _sum(counted: Iterable[ConfigurationCounts]) -> ConfigurationCounts:
    total = ConfigurationCounts()
    for item in counted:
        total = replace(
            total,
            predictions=total.predictions + item.predictions,
            errors=total.errors + item.errors,
            successes=total.successes + item.successes,
            failures=total.failures + item.failures,
        )
    return total
