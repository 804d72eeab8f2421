"""What stored predictions show: against their demonstrations, the robot's path, and the success of configurations."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from statistics import median
from typing import Any

import numpy as np
from sqlalchemy import Connection

from app.llm.computed import YARDSTICKS
from app.pipeline.deviation import ActionDeviation, ObjectReach, action_deviations, object_reach
from app.pipeline.episode import Demonstration
from app.pipeline.success_rate import Pairs
from app.services.predict.demonstrations import Demonstrations, in_all
from app.services.predict.known import KnownReader
from app.services.predict.placed import previewed
from app.services.task_settings import TaskSettings
from app.store import prediction_lists, tasks
from app.store.prediction_lists import Attempt, Configuration, Counts
from app.store.records import PredictionRecord
from roboprompt_client.arms.preview import Previewed
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, Pose

MAX_COMPARED = 8  # configurations at once


@dataclass(frozen=True)
class Explanation:
    """How objects and actions of a prediction differ from its demonstrations.

    Attributes:
        reaches: by object name; empty without demonstrations.
        deviations: of each action; empty where no demonstration does the same in as many actions.
    """

    reaches: dict[str, ObjectReach]
    deviations: tuple[ActionDeviation, ...]


def explanation(
    connection: Connection, known: KnownReader, record: PredictionRecord, ids: Sequence[str]
) -> Explanation:
    """Compare a prediction with those of its demonstrations that are still stored, of these ids."""
    task = known.task(connection, record.task)
    objects = task.folded([item.pose() for item in record.objects])
    return explain_prediction(record, objects, task.demonstrations(tuple(ids)))


def explain_prediction(
    record: PredictionRecord, objects: Sequence[ObjectPose], demonstrations: Demonstrations
) -> Explanation:
    """Compare a prediction with these of its demonstrations.

    Args:
        objects: as the prediction observed them, symmetric ones turned to the side that demonstrations have.
    """
    shown_names = [[pose.name for pose in item.objects] for item in demonstrations.recorded]
    names = in_all([[pose.name for pose in objects], *shown_names])
    shown = demonstrations.only(names).recorded
    observed = tuple(pose for pose in objects if pose.name in names)
    instruction = str(record.grounding["instruction"])  # as the LLM read it
    predicted = Demonstration(instruction, observed, tuple(_actions(record)))
    reaches = {pose.name: object_reach(pose, shown) for pose in observed} if shown else {}
    return Explanation(reaches, action_deviations(predicted, shown))


def _actions(record: PredictionRecord) -> Iterator[EndEffectorAction]:
    for item in record.actions or ():
        yield EndEffectorAction(np.array(item["position"]), np.array(item["quaternion_xyzw"]), item["gripper_open"])


def path_of(record: PredictionRecord, settings: TaskSettings) -> tuple[Previewed, ...]:
    """Return each action with distance from the base, reachability, and the present keep-out boxes in the way.

    An arm that the settings name is assumed to move straight from its maker's ready pose to the request's end effector
    pose.
    """
    hand = record.request.get("end_effector")
    pose = None if hand is None else Pose(hand["position"], hand["quaternion_xyzw"])
    return previewed(list(_actions(record)), settings, pose)


def configuration(record: PredictionRecord) -> dict[str, Any]:
    """Return the options that a prediction was made with, by their names in requests."""
    asked = ("selection", "seed", "max_actions", "num_samples", "temperature")
    return {
        "model": record.model,
        "representation": record.representation,
        "prompt_format": record.prompt_format,
        "num_demonstrations": len(record.demonstration_ids),
        **{name: record.request[name] for name in asked if name in record.request},
    }


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
