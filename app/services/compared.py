"""Poses that came with a request beside those that images show of the same objects."""

from collections.abc import Iterable

from app.perception.base import GivenPoses, ObjectQuery
from app.perception.models import model_from_json
from app.pipeline.findings.frames import GIVEN, Compared
from app.services.task_settings import TaskSettings
from roboprompt_client.types.poses import ObjectPose


def compared(given: Iterable[ObjectQuery], found: Iterable[ObjectPose], settings: TaskSettings) -> tuple[Compared, ...]:
    """The objects that came with a pose, and were found in images as well."""
    said = {query.name: query for query in given if query.position_m is not None}
    return tuple(
        Compared(GivenPoses().estimate([said[pose.name]], ())[0], pose, _turn_deg(pose.name, settings))
        for pose in found
        if pose.name in said and pose.estimator != GIVEN
    )


def _turn_deg(name: str, settings: TaskSettings) -> float | None:
    """About its z axis that leaves the object unchanged, as the task or its model says: 0 any, None none."""
    if name in settings.yaw_symmetry_deg:
        return settings.yaw_symmetry_deg[name]
    model = settings.object_models.get(name)
    turn_deg: float | None = getattr(model and model_from_json(name, model), "yaw_symmetry_deg", None)
    return turn_deg
