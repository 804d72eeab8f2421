"""Object models from JSON, by the estimator that reads them.

A task's setting `object_models` is ``{"red cube": {"estimator": "cuboid", "size_m": [...], ...}}``. To add a kind of
model, write a subclass of `ObjectModel` and name it in `MODELS`.
"""

from collections.abc import Mapping
from typing import Any

from app.perception.cuboid_model import CuboidModel
from app.perception.marker_model import MarkersModel
from app.perception.masks_model import MasksModel
from app.perception.object_model import ObjectModel, within
from app.perception.remote_model import RemoteModel
from app.pipeline.errors import InvalidInputError

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
