"""Pose servers: which of them may be sent images, and this service as one of them.

Who may configure a task must not thereby reach every address from here. `POST /poses` offers objects' poses to other
instances, apart from any task.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import httpx

from app.perception.base import ObjectQuery
from app.perception.models import RemoteModel, model_from_json
from app.perception.object_model import ObjectModel, ObjectModelError
from app.perception.poses_wire import PoseQuestion
from app.perception.registry import estimate_poses
from app.pipeline.prompt import check_object_names
from app.services.scene_images import with_templates
from app.store.blobs import BlobStore
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.http.connection import is_loopback
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose

SETTING = "ROBOPROMPT_POSE_SERVERS"
REMEDY = 'an object model, e.g. {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}, or mask_ids'


class PoseServers:
    """The servers that the estimator `remote` may ask.

    Args:
        prefixes: of their addresses, e.g. ``https://gpu-box:9000/``; none: this machine only.
    """

    def __init__(self, prefixes: Sequence[str] = ()) -> None:
        self._prefixes = tuple(map(httpx.URL, prefixes))

    def check(self, object_models: Mapping[str, Mapping[str, Any]]) -> None:
        """Refuse models whose server is none of them; models of other estimators pass.

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
    """Whether `url` is `prefix` or continues its path, on the same server."""
    if (url.scheme, url.host, _port(url)) != (prefix.scheme, prefix.host, _port(prefix)):
        return False
    folder = prefix.path.rstrip("/") + "/"
    return ".." not in url.path and (url.path == prefix.path or url.path.startswith(folder))


def _port(url: httpx.URL) -> int | None:
    return url.port or {"http": 80, "https": 443}.get(url.scheme)


def find_poses(
    questions: Sequence[PoseQuestion], frames: Sequence[RgbdFrame], blobs: BlobStore
) -> tuple[ObjectPose, ...]:
    """One pose per question, in their order; objects without a model are found by their masks.

    Args:
        blobs: where the templates of registered objects are.

    Raises:
        as PoseEstimator.estimate; InvalidInputError for a model that is not valid, or is for a further server.
    """
    names = [question.name for question in questions]
    check_object_names(names, list(dict.fromkeys(names)))
    queries = [ObjectQuery(item.name, mask_ids=item.mask_ids, model=_model(item)) for item in questions]
    return estimate_poses("masks", with_templates(queries, blobs), frames)


def _model(question: PoseQuestion) -> ObjectModel | None:
    where = f"objects[{question.name}].model"
    if question.model is None:
        if not question.mask_ids:
            raise InvalidInputError(where, "is missing", REMEDY)
        return None
    model = model_from_json(question.name, question.model, where)
    if isinstance(model, RemoteModel):
        # a server that asked on could be sent round in circles
        raise InvalidInputError(f"{where}.estimator", "is 'remote'", "cuboid, markers, masks, registered")
    return model
