"""The interface of pose estimators, g(V, M_j) of the paper (section III-C).

The simplest is `GivenPoses`: it returns poses that the request contains. Object models are learned from labeled scenes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self, TypeVar

import numpy as np

from app.perception.models import model_from_json
from app.perception.object_model import ObjectModel, ObjectModelError
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.names import checked_object_name
from roboprompt_client.types.poses import ObjectPose

M = TypeVar("M", bound=ObjectModel)
GIVEN = "given"
ESTIMATOR_NAMES = (GIVEN, "masks", "cuboid", "markers", "registered", "remote")


@dataclass(frozen=True)
class ObjectQuery:
    """An object to find, with the caller's knowledge about it.

    Attributes:
        position_m: (3,) in the world frame, if the caller knows it.
        quaternion_xyzw: (4,) in the world frame, if the caller knows it.
        mask_ids: the ids of its pixels in the mask images.
        model: its shape, color or markers, for the estimator.
    """

    name: str
    position_m: tuple[float, ...] | None = None
    quaternion_xyzw: tuple[float, ...] | None = None
    mask_ids: tuple[int, ...] = ()
    model: ObjectModel | None = None

    def __post_init__(self) -> None:
        checked_object_name("objects.name", self.name)
        if self.quaternion_xyzw is not None and self.position_m is None:
            raise InvalidInputError(f"objects[{self.name}].quaternion_xyzw", "has no position beside it", "both")

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> Self:
        """Return the query whose `dataclasses.asdict`, perhaps read back from JSON, is given."""
        position, quaternion, model = value["position_m"], value["quaternion_xyzw"], value.get("model")
        return cls(
            value["name"],
            None if position is None else tuple(position),
            None if quaternion is None else tuple(quaternion),
            tuple(value["mask_ids"]),
            None if model is None else model_from_json(value["name"], model),
        )


def model_of(query: ObjectQuery, kind: type[M], example: str) -> M:
    """Return the query's object model, which must be of the class `kind`.

    Args:
        example: a valid model as JSON, for the error.

    Raises:
        ObjectModelError: if the query has no model, or one for another estimator.
    """
    if isinstance(query.model, kind):
        return query.model
    what = "is missing" if query.model is None else f"is for the estimator {query.model.estimator!r}"
    raise ObjectModelError(query.name, what, example)


class PoseEstimator(Protocol):
    """Finds named objects in calibrated RGB-D frames."""

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        """Return one pose for each object, in the given order.

        Raises:
            InvalidInputError: if a query lacks what this estimator needs.
            ObjectNotVisibleError: if no camera sees an object; names it.
            UncertainPoseError: if an object is seen but its pose is uncertain; names object, cameras and cause.
        """
        ...


class GivenPoses:
    """Takes each object's pose from its query and ignores images."""

    def estimate(self, objects: Sequence[ObjectQuery], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
        poses = []
        for query in objects:
            if query.position_m is None:
                remedy = "a position [x, y, z] in meters, or images and the task's object_models to find it in them"
                raise InvalidInputError(f"objects[{query.name}].position", "is missing", remedy)
            rotation = None if query.quaternion_xyzw is None else np.array(query.quaternion_xyzw)
            poses.append(ObjectPose(query.name, np.array(query.position_m), rotation, estimator=GIVEN))
        return tuple(poses)


@dataclass(frozen=True, eq=False)
class LabeledScene:
    """The first images of a demonstration, with labeled objects.

    Attributes:
        frames: RGB-D of one or more cameras; with masks for objects that have mask ids.
        objects: each with mask ids, a position, or both; a given position defines the origin of the learned model.
    """

    frames: tuple[RgbdFrame, ...]
    objects: tuple[ObjectQuery, ...]
