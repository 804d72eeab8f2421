"""Poses that the request itself carries."""

from collections.abc import Sequence

import numpy as np

from app.perception.base import ObjectQuery
from app.pipeline.camera import RgbdFrame
from app.pipeline.episode import ObjectPose
from app.pipeline.errors import InvalidInputError


class GivenPoses:
    """Takes each object's pose from its query; looks at no image."""

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        return tuple(self._pose(query) for query in objects)

    def _pose(self, query: ObjectQuery) -> ObjectPose:
        if query.position_m is None:
            remedy = "a position [x, y, z] in metres, or images and the task's object_models to find it in them"
            raise InvalidInputError(f"objects[{query.name}].position", "is missing", remedy)
        rotation = None if query.quaternion_xyzw is None else np.array(query.quaternion_xyzw)
        return ObjectPose(query.name, np.array(query.position_m), rotation, estimator="given")
