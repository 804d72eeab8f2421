"""The success of a task's predictions, by configuration; two configurations are compared in pairs of outcomes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from statistics import median

from sqlalchemy import Connection

from app.llm.computed import YARDSTICKS
from app.pipeline.success_rate import Pairs
from app.store import prediction_lists, tasks
from app.store.prediction_lists import Attempt, Configuration, Counts
from roboprompt_client.errors import InvalidInputError

MAX_COMPARED = 8  # configurations at once


@dataclass(frozen=True)
class Standing:
    """The predictions of one configuration; `latest` are the last of them, oldest first."""

    configuration: Configuration
    counts: Counts
    latest: tuple[Attempt, ...]

    @property
    def is_yardstick(self) -> bool:
        return self.configuration.model in YARDSTICKS

    @property
    def outcomes(self) -> tuple[bool, ...]:
        """Whether robots succeeded, oldest first; only where that was recorded."""
        return tuple(trial.success for trial in self.latest if trial.success is not None)

    @property
    def llm_ms(self) -> float | None:
        """How long the model took for the median of its replies."""
        times = [trial.llm_ms for trial in self.latest if trial.llm_ms is not None]
        return median(times) if times else None

    @property
    def tokens(self) -> tuple[float, float] | None:
        known = [trial.tokens for trial in self.latest if trial.tokens is not None]
        return (median(prompt for prompt, _ in known), median(reply for _, reply in known)) if known else None


@dataclass(frozen=True)
class StandingComparison:
    """Two configurations and the outcomes of both, in pairs as they came."""

    one: Standing
    other: Standing

    @property
    def pairs(self) -> Pairs:
        """The k-th outcome of the one with the k-th of the other."""
        return Pairs.of(self.one.outcomes, self.other.outcomes)


@dataclass(frozen=True)
class TaskStats:
    """A task's predictions: together, and of each configuration, the surest success first."""

    total: Counts
    standings: tuple[Standing, ...]

    def comparisons(self, ids: Sequence[str]) -> tuple[StandingComparison, ...]:
        """Each of the configurations of these ids with each other.

        Raises:
            InvalidInputError: for an unknown id, and for too many.
        """
        by_id = {item.configuration.id: item for item in self.standings}
        if unknown := [id_ for id_ in ids if id_ not in by_id]:
            raise InvalidInputError("compare", f"is {unknown[0]!r:.40}", "an id of a configuration of this task")
        if len(ids) > MAX_COMPARED:
            raise InvalidInputError("compare", f"names {len(ids)} configurations", f"at most {MAX_COMPARED}")
        chosen = [by_id[id_] for id_ in dict.fromkeys(ids)]
        return tuple(StandingComparison(one, other) for one, other in combinations(chosen, 2))


def task_stats(connection: Connection, task: str | None) -> TaskStats:
    """The stored outcomes of a task, or of all, summed up; raises NotFoundError if there is no such task."""
    if task is not None:
        tasks.get(connection, task)
    counted = prediction_lists.counts_by_configuration(connection, task)
    latest = prediction_lists.latest_by_configuration(connection, task)
    standings = [Standing(key, counts, latest.get(key, ())) for key, counts in counted.items()]
    surest = sorted(standings, key=lambda standing: standing.counts.rate.interval[0], reverse=True)
    names = ("predictions", "errors", "successes", "failures", "priced")
    total = Counts(**{name: sum(getattr(counts, name) for counts in counted.values()) for name in names})
    costs = [counts.cost_usd for counts in counted.values() if counts.cost_usd is not None]
    return TaskStats(replace(total, cost_usd=sum(costs) if costs else None), tuple(surest))
