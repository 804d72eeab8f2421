"""Objects' poses in images: found by the task's models and templates or by pose servers, and drawn in.

Pose servers are those that images may be sent to, and this service as one (`POST /poses`). Without a list of them,
whoever may configure a task could let this service send requests to any address of its network.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import cv2
import httpx
import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.base import GIVEN, GivenPoses, ObjectQuery
from app.perception.models import RemoteModel, model_from_json
from app.perception.object_model import ObjectModelError
from app.perception.overlay import draw_overlay
from app.perception.registered.estimator import TaughtQuery
from app.perception.registered.model import RegisteredModel
from app.perception.registered.template import Template
from app.perception.registry import estimate_poses
from app.pipeline.names import check_object_names
from app.services.cache import Cache
from app.services.images import read_frame, stored_image
from app.services.task_settings import TaskSettings
from app.store import episodes, predictions
from app.store.blobs import BlobStore
from app.store.errors import CorruptDataError
from app.store.store import Store
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.http import is_loopback
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose

SETTING = "ROBOPROMPT_POSE_SERVERS"
REMEDY = 'an object model, e.g. {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}, or mask_ids'
SAME_M, SAME_DEG = 0.015, 15.0  # a given and a found pose that differ by less use the same object frame
MAX_TEMPLATES = 16  # in memory, some MB each
_decoded: Cache[str, Template] = Cache(MAX_TEMPLATES)  # of any store: a digest names the same bytes everywhere


@dataclass(frozen=True)
class Compared:
    """An object in an episode that has both a given pose and images in which the object was found.

    Attributes:
        turn_deg: the turn about its z axis that leaves it unchanged: 0 any, None none.
    """

    given: ObjectPose
    found: ObjectPose
    turn_deg: float | None = None

    @property
    def off_m(self) -> float:
        """The distance between the two positions."""
        return float(np.linalg.norm(self.given.position_m - self.found.position_m))

    @property
    def off_deg(self) -> float:
        """The least angle between the two rotations under the symmetry; 0 where one is not known."""
        if self.given.quaternion_xyzw is None or self.found.quaternion_xyzw is None:
            return 0.0
        between = Rotation.from_quat(self.given.quaternion_xyzw).inv() * Rotation.from_quat(self.found.quaternion_xyzw)
        if self.turn_deg == 0:
            return float(np.degrees(np.arccos(np.clip(between.as_matrix()[2, 2], -1, 1))))
        turns = Rotation.from_euler("z", np.arange(0, 360, self.turn_deg or 360)[:, None], degrees=True)
        return float(np.degrees((between * turns).magnitude().min()))

    @property
    def agrees(self) -> bool:
        """Whether both use the same object frame."""
        return self.off_m <= SAME_M and self.off_deg <= SAME_DEG


def with_models(objects: Iterable[ObjectQuery], settings: TaskSettings) -> tuple[ObjectQuery, ...]:
    """The objects with the models that the task has of them."""
    return tuple(
        query
        if (model := settings.object_models.get(query.name)) is None
        else replace(query, model=model_from_json(query.name, model))
        for query in objects
    )


def poses_of(
    objects: Iterable[ObjectQuery],
    settings: TaskSettings,
    frames: Sequence[RgbdFrame],
    blobs: BlobStore,
    *,
    given_first: bool,
) -> tuple[ObjectPose, ...]:
    """The poses of a task's objects; raises as `with_template` and `estimate_poses`."""
    queries = [with_template(query, blobs) for query in with_models(objects, settings)]
    return tuple(estimate_poses(settings.pose_estimator, queries, frames, given_first=given_first))


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


def with_template(query: ObjectQuery, blobs: BlobStore) -> ObjectQuery:
    """The query of an object; of a registered one with its template.

    Raises:
        ObjectModelError: if the template is not stored.
        StoreUnavailableError: if it cannot be read.
    """
    if not isinstance(query.model, RegisteredModel):
        return query
    digest = query.model.template
    try:
        template = _decoded.get_or_make(digest, lambda: Template.from_bytes(blobs.read(digest)))
    except (CorruptDataError, InvalidInputError) as error:
        message = f"is {digest!r}, which is not stored here as a template ({error})"
        remedy = "what POST /tasks/{name}/labels/learn gives"
        raise ObjectModelError(query.name, message, remedy, within="template") from None
    return TaughtQuery(**vars(query), template=template)


def overlay_of(store: Store, kind: Literal["episode", "prediction"], id_: str, camera: str) -> bytes:
    """A PNG of what the camera saw first, with the axes and names of the objects that were found.

    Raises:
        NotFoundError: if there is no such episode or prediction, or it has no color image of that camera.
    """
    with store.read() as connection:
        record = episodes.get(connection, id_) if kind == "episode" else predictions.get(connection, id_)
    stored, _ = stored_image(record.cameras, camera, "rgb", f"{kind} {id_}")
    image = draw_overlay(read_frame(store.blobs, stored), [item.pose() for item in record.objects])
    return cv2.imencode(".png", image[..., ::-1])[1].tobytes()


class PoseServers:
    """The servers that the estimator `remote` may ask.

    Args:
        prefixes: of their addresses, e.g. ``https://gpu-box:9000/``; none: this machine only.
    """

    def __init__(self, prefixes: Sequence[str] = ()) -> None:
        self._prefixes = tuple(map(httpx.URL, prefixes))

    def check(self, object_models: Mapping[str, Mapping[str, Any]]) -> None:
        """Refuse models of other servers; models of other estimators pass.

        Raises:
            InvalidInputError: naming the object, the address and the setting that would allow it.
        """
        for name, model in object_models.items():
            if model["estimator"] == "remote" and not self._allow(httpx.URL(model["url"])):
                allowed = ", ".join(map(str, self._prefixes)) or "this machine only"
                message = f"is {model['url']!r}, where this service may not send images"
                raise ObjectModelError(name, message, f"{allowed} (set by {SETTING})", within="url")

    def _allow(self, url: httpx.URL) -> bool:
        if not self._prefixes:
            return is_loopback(url.host)
        return any(_below(url, prefix) for prefix in self._prefixes)


def _below(url: httpx.URL, prefix: httpx.URL) -> bool:
    """Return whether `url` is `prefix` or continues its path, on the same server."""
    if (url.scheme, url.host, url.port) != (prefix.scheme, prefix.host, prefix.port):
        return False
    folder = prefix.path.rstrip("/") + "/"
    return ".." not in url.path and (url.path == prefix.path or url.path.startswith(folder))


def find_poses(queries: Sequence[ObjectQuery], frames: Sequence[RgbdFrame], blobs: BlobStore) -> tuple[ObjectPose, ...]:
    """Return one pose for each object, in their order; objects without a model are found by their masks.

    Args:
        blobs: have the templates of registered objects.

    Raises:
        as PoseEstimator.estimate; InvalidInputError for an object that has neither model nor mask ids, or whose model
            is for another server.
    """
    names = [query.name for query in queries]
    check_object_names(names, list(dict.fromkeys(names)))
    for query in queries:
        where = f"objects[{query.name}].model"
        if query.model is None and not query.mask_ids:
            raise InvalidInputError(where, "is missing", REMEDY)
        if isinstance(query.model, RemoteModel):  # servers that ask each other would never end
            raise InvalidInputError(f"{where}.estimator", "is 'remote'", "cuboid, markers, masks, registered")
    return estimate_poses("masks", [with_template(query, blobs) for query in queries], frames)
