"""Positions from segmentation masks and depth, as the authors' code does it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from app.perception.base import ObjectQuery
from app.perception.masked_rotation import box_around
from app.perception.masks_model import MasksModel
from app.pipeline.arrays import Array
from app.pipeline.camera import RgbdFrame
from app.pipeline.episode import ObjectPose
from app.pipeline.errors import InvalidInputError, ObjectNotVisibleError
from app.pipeline.geometry import backproject

Mask = npt.NDArray[np.int32]


class MaskedPoints:
    """Per camera the mean of an object's back-projected pixels; over the cameras that see it, their unweighted mean.

    Gives a position only, unless the object's model asks for a rotation. The visible surface lies nearer to the cameras
    than the object's centre.
    """

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        masked = [(frame, frame.mask) for frame in frames if frame.mask is not None]
        if not masked:
            raise InvalidInputError("cameras", "no camera has a mask", "mask_NAME beside depth_NAME for some camera")
        return tuple(self._pose(query, masked) for query in objects)

    def _pose(self, query: ObjectQuery, frames: Sequence[tuple[RgbdFrame, Mask]]) -> ObjectPose:
        if not query.mask_ids:
            remedy = "the ids of its pixels in the mask images, e.g. [98]"
            raise InvalidInputError(f"objects[{query.name}].mask_ids", "is missing or empty", remedy)
        means_m: dict[str, Array] = {}
        for frame, mask in frames:
            points_m = backproject(frame, np.isin(mask, query.mask_ids))
            if len(points_m):
                means_m[frame.camera.name] = points_m.mean(axis=0)
        if not means_m:
            cameras = ", ".join(frame.camera.name for frame, _ in frames)
            message = f"no camera ({cameras}) has pixels with id {list(query.mask_ids)} and known depth"
            raise ObjectNotVisibleError(f"objects[{query.name}]", message, "mask_ids that some mask image contains")
        position_m = np.mean(list(means_m.values()), axis=0)
        pose = ObjectPose(query.name, position_m, None, estimator="masks", cameras=tuple(means_m))
        if not (isinstance(query.model, MasksModel) and query.model.rotation):
            return pose
        box = box_around(query, query.model, [frame for frame, _ in frames])
        return replace(box, position_m=position_m)
