"""Object models from JSON, by the estimator that reads them; those of `masks` and `remote` are defined here.

A task's setting `object_models` is ``{"red cube": {"estimator": "cuboid", "size_m": [...], ...}}``. To add a kind of
model, write a subclass of `ObjectModel` and name it in `MODELS`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import httpx

from app.perception.cuboid.model import CuboidModel
from app.perception.markers.model import MarkersModel
from app.perception.object_model import MIN_CONFIDENCE, ObjectModel, number, one_of, within
from roboprompt_client.errors import InvalidInputError

MAX_TIMEOUT_S = 300.0


@dataclass(frozen=True)
class MasksModel(ObjectModel):
    """An object that segmentation masks show.

    Attributes:
        rotation: whether to give the yaw of an upright box around the masked points, too.
        yaw_symmetry_deg: 90 for a square footprint; 180 for one with a longer side, which then is the x axis.
    """

    estimator: Literal["masks"] = field(default="masks", init=False)
    rotation: bool = False
    yaw_symmetry_deg: float = 90.0

    def __post_init__(self) -> None:
        one_of("rotation", self.rotation, (False, True))
        one_of("yaw_symmetry_deg", self.yaw_symmetry_deg, (90, 180))


@dataclass(frozen=True)
class RemoteModel(ObjectModel):
    """An object that a server finds.

    Attributes:
        url: the whole address that images are posted to, e.g. ``http://gpu-box:8000/poses``.
        timeout_s: the answer comes within it, retries included, or the server counts as unavailable.
        model: what the server wants to know of the object; sent as it is. Another instance of this service wants an
            object model, e.g. a `CuboidModel`'s JSON; a FoundationPose wrapper perhaps ``{"mesh": "mug.obj"}``.
        min_confidence: a pose that is less certain is refused.
    """

    estimator: Literal["remote"] = field(default="remote", init=False)
    url: str
    timeout_s: float = 10.0
    model: Mapping[str, Any] | None = None
    min_confidence: float = MIN_CONFIDENCE

    def __post_init__(self) -> None:
        _check_url(self.url)
        valid = f"seconds, above 0 and up to {MAX_TIMEOUT_S:g}"
        if number("timeout_s", self.timeout_s, valid=valid, low=0.0, high=MAX_TIMEOUT_S) == 0:
            raise InvalidInputError("timeout_s", f"is {self.timeout_s!r}", valid)
        number("min_confidence", self.min_confidence, valid="a number in 0..1", low=0.0, high=1.0)
        if self.model is not None and not isinstance(self.model, Mapping):
            raise InvalidInputError("model", f"is {self.model!r}", "a JSON object, or null")


def _check_url(url: object) -> None:
    valid = "an address like http://127.0.0.1:8000/poses"
    try:
        parsed = httpx.URL(url) if isinstance(url, str) else httpx.URL("")
    except httpx.InvalidURL as error:
        raise InvalidInputError("url", f"is {url!r}: {error}", valid) from None
    if parsed.scheme not in ("http", "https") or not parsed.host:
        raise InvalidInputError("url", f"is {url!r}", valid)
    if parsed.userinfo:
        raise InvalidInputError("url", "has a user name or password in it, which everyone can read", valid)


MODELS: Mapping[str, type[ObjectModel]] = {
    "cuboid": CuboidModel,
    "masks": MasksModel,
    "markers": MarkersModel,
    "remote": RemoteModel,
}


def model_from_json(name: str, value: Mapping[str, Any]) -> ObjectModel:
    """The model of the object `name`; the inverse of `as_json`.

    Raises:
        InvalidInputError: naming the field as ``object_models[NAME].FIELD``, its value and what is valid.
    """
    where = f"object_models[{name}]"
    estimator = value.get("estimator") if isinstance(value, Mapping) else None
    if not isinstance(estimator, str) or estimator not in MODELS:
        raise InvalidInputError(f"{where}.estimator", f"is {estimator!r}", ", ".join(MODELS))
    try:
        return MODELS[estimator].from_json(value)
    except InvalidInputError as error:
        raise within(where, error) from None
