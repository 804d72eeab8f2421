"""What a stored prediction shows: its difference from the demonstrations, the robot's path, and its options."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from app.pipeline.deviation import ActionDeviation, ObjectReach, action_deviations, object_reach
from app.pipeline.episode import Demonstration, start_at
from app.services.predict.demonstrations import Demonstrations, TaskReading
from app.services.predict.placed import previewed
from app.services.predict.scenes import in_all
from app.services.task_settings import TaskSettings
from app.store.records import PredictionRecord
from roboprompt_client.arms.preview import Previewed
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, Pose


@dataclass(frozen=True)
class Explanation:
    """How objects and actions of a prediction differ from its demonstrations.

    Attributes:
        reaches: by object name; empty without demonstrations.
        deviations: of each action; empty where no demonstration does the same in as many actions.
    """

    reaches: dict[str, ObjectReach]
    deviations: tuple[ActionDeviation, ...]


def explanation(task: TaskReading, record: PredictionRecord, ids: Sequence[str]) -> Explanation:
    """Compare a prediction with those of its demonstrations that are still stored, of these ids."""
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
    predicted = Demonstration(instruction, observed, tuple(_actions(record)), start=start_at(_hand(record)))
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
    return previewed(list(_actions(record)), settings, _hand(record))


def _hand(record: PredictionRecord) -> Pose | None:
    """Return the hand's pose that the request had."""
    hand = record.request.get("end_effector")
    return None if hand is None else Pose(hand["position"], hand["quaternion_xyzw"])
