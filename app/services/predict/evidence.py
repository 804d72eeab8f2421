"""What recorded predictions are judged by: their demonstrations, the robot's path, and how robots fared with them.

A prediction is compared with its demonstrations; successes are counted by model and configuration of a task.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.pipeline.deviation import ActionDeviation, ObjectReach, action_deviations, object_reach
from app.pipeline.episode import Demonstration
from app.pipeline.success_rate import SuccessRate
from app.services.predict.demonstrations import Demonstrations
from app.services.predict.select import in_all
from app.services.task_settings import TaskSettings
from app.store import predictions, tasks
from app.store.records import ConfigurationCounts, PredictionRecord
from app.store.store import Store
from roboprompt_client import quaternions
from roboprompt_client.arms.calibration import Calibration
from roboprompt_client.arms.panda import PandaGeometry
from roboprompt_client.arms.preview import Previewed, preview_plan
from roboprompt_client.arrays import Array
from roboprompt_client.errors import MotionError
from roboprompt_client.trajectory import EndEffectorAction


@dataclass(frozen=True)
class Explanation:
    """Where objects and actions of a prediction lie among its demonstrations.

    Attributes:
        reaches: by object name; empty without demonstrations.
        deviations: of each action; empty where no demonstration does the same in as many actions.
    """

    reaches: dict[str, ObjectReach]
    deviations: tuple[ActionDeviation, ...]


def explain_prediction(record: PredictionRecord, demonstrations: Demonstrations) -> Explanation:
    """Hold a prediction against those of its demonstrations that are still stored."""
    shown_names = [[pose.name for pose in item.objects] for item in demonstrations.recorded]
    names = in_all([[item.name for item in record.objects], *shown_names])
    shown = demonstrations.only(names).recorded
    observed = tuple(item.pose() for item in record.objects if item.name in names)
    predicted = Demonstration(_canonical(record), observed, tuple(_actions(record)))
    reaches = {pose.name: object_reach(pose, shown) for pose in observed} if shown else {}
    # A step of a closed loop is one action out of several; its demonstrations are not divided by step here.
    deviations = action_deviations(predicted, shown) if record.step is None else ()
    return Explanation(reaches, deviations)


def _canonical(record: PredictionRecord) -> str:
    """The instruction as the LLM read it."""
    return str(record.grounding["instruction"])


def _actions(record: PredictionRecord) -> Iterator[EndEffectorAction]:
    for item in record.actions or ():
        yield EndEffectorAction(np.array(item["position"]), np.array(item["quaternion_xyzw"]), item["gripper_open"])


def path_of(record: PredictionRecord, settings: TaskSettings) -> tuple[Previewed, ...]:
    """Each action with its distance from the base, its reach, and the boxes of today's settings on the way to it.

    The arm, where the settings name one, is thought to come from its maker's ready pose straight to where the request
    said that the hand was.
    """
    base = Calibration(np.array(settings.robot_base), quaternions.IDENTITY)
    geometry = None if settings.arm is None else PandaGeometry(settings.arm)
    hand = record.request.get("end_effector")
    joints = None if geometry is None else _start(geometry, base, hand)
    start_m = None if hand is None else hand["position"]
    limits, actions = settings.limits_of_motion(), list(_actions(record))
    return preview_plan(actions, base, limits, geometry=geometry, joints_rad=joints, start_m=start_m)


def _start(geometry: PandaGeometry, base: Calibration, hand: Mapping[str, Any] | None) -> Array:
    if hand is None:
        return geometry.ready_rad
    position_m, quaternion = np.array(hand["position"]), np.array(hand["quaternion_xyzw"])
    try:
        return geometry.way(geometry.ready_rad, *base.to_base(position_m, quaternion))
    except MotionError:
        return geometry.ready_rad


def configuration(record: PredictionRecord) -> dict[str, Any]:
    """The settings that a prediction was made with, as a request names them."""
    asked = (
        "selection",
        "seed",
        "max_actions",
        "closed_loop",
        "num_samples",
        "temperature",
    )
    return {
        "model": record.model,
        "representation": record.representation,
        "prompt_format": record.prompt_format,
        "num_demonstrations": len(record.demonstration_ids),
        **{name: record.request[name] for name in asked if name in record.request},
    }


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
