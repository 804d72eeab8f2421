"""Pose servers: the ones that images may be sent to, and this service as one (`POST /poses`).

Without the list, whoever may configure a task could let this service send requests to any address of its network.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import httpx

from app.perception.base import ObjectQuery
from app.perception.models import RemoteModel
from app.perception.object_model import ObjectModelError
from app.perception.registry import estimate_poses
from app.pipeline.names import check_object_names
from app.services.scene_images import with_templates
from app.store.blobs import BlobStore
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.http import is_loopback
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
    return estimate_poses("masks", with_templates(queries, blobs), frames)
