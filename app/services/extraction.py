"""Episode -> keyframes and object poses, as the task's settings want them."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.perception.base import ObjectQuery
from app.perception.registry import pose_estimator
from app.pipeline.episode import ObjectPose, RgbdFrame, Trajectory
from app.pipeline.errors import InvalidInputError
from app.pipeline.keyframes import find_keyframes
from app.services.task_settings import TaskSettings
from app.store.values import KeyframeRecord, ObjectRecord


@dataclass(frozen=True)
class Extracted:
    """What a prompt will say of an episode."""

    keyframes: tuple[KeyframeRecord, ...]
    objects: tuple[ObjectRecord, ...]


def extract(
    trajectory: Trajectory, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame], settings: TaskSettings
) -> Extracted:
    """Find the keyframes and estimate the objects' poses.

    Raises:
        InvalidInputError: if there is no keyframe, or an object cannot be found.
    """
    indices = find_keyframes(trajectory, settings.keyframes.keyframe_rule())
    if not indices:
        message = f"no keyframe in {len(trajectory)} frames by rule {settings.keyframes.rule!r}"
        raise InvalidInputError("trajectory", message, "an episode in which the robot moves and then rests")
    poses: tuple[ObjectPose, ...] = pose_estimator(settings.pose_estimator).estimate(objects, frames)
    keyframes = tuple(KeyframeRecord.of(index, trajectory.action_at(index)) for index in indices)
    return Extracted(keyframes, tuple(ObjectRecord.of(pose) for pose in poses))
