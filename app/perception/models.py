"""Object models from JSON, by the estimator that reads them; those of `masks` and `remote` are defined here.

A task's setting `object_models` is ``{"red cube": {"estimator": "cuboid", "size_m": [...], ...}}``. To add a kind of
model, write a subclass of `ObjectModel` and name it in `AnyModel` and `MODELS`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any, Literal

import httpx
from pydantic import Field, GetJsonSchemaHandler, TypeAdapter, ValidationError
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, ErrorDetails

from app.perception.cuboid.model import CuboidModel
from app.perception.markers.model import MarkersModel
from app.perception.object_model import MIN_CONFIDENCE, Confidence, Number, ObjectModel, Truth, one_of, within
from app.perception.registered.model import RegisteredModel
from roboprompt_client.errors import InvalidInputError

MAX_TIMEOUT_S = 300.0
_URL = "an address like http://127.0.0.1:8000/poses"


@dataclass(frozen=True)
class MasksModel(ObjectModel):
    """An object that segmentation masks show.

    Attributes:
        rotation: whether to give the yaw of an upright box around the masked points, too.
        yaw_symmetry_deg: 90 for a square footprint; 180 for one with a longer side, which then is the x axis.
    """

    estimator: Literal["masks"] = field(default="masks", kw_only=True)
    rotation: Truth = False
    yaw_symmetry_deg: Annotated[Number, Field(json_schema_extra={"enum": [90, 180]})] = 90.0

    def __post_init__(self) -> None:
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

    estimator: Literal["remote"] = field(default="remote", kw_only=True)
    url: Annotated[str, Field(description=_URL)]
    timeout_s: Annotated[
        Number, Field(gt=0, le=MAX_TIMEOUT_S, description=f"seconds, above 0 and up to {MAX_TIMEOUT_S:g}")
    ] = 10.0
    model: dict[str, Any] | None = None
    min_confidence: Confidence = MIN_CONFIDENCE

    def __post_init__(self) -> None:
        try:
            parsed = httpx.URL(self.url)
        except httpx.InvalidURL as error:
            raise InvalidInputError("url", f"is {self.url!r}: {error}", _URL) from None
        if parsed.scheme not in ("http", "https") or not parsed.host:
            raise InvalidInputError("url", f"is {self.url!r}", _URL)
        if parsed.userinfo:
            raise InvalidInputError("url", "has a user name or password in it, which everyone can read", _URL)


AnyModel = Annotated[
    CuboidModel | MasksModel | MarkersModel | RegisteredModel | RemoteModel, Field(discriminator="estimator")
]
_ADAPTER: TypeAdapter[CuboidModel | MasksModel | MarkersModel | RegisteredModel | RemoteModel] = TypeAdapter(AnyModel)
MODELS = ("cuboid", "masks", "markers", "registered", "remote")


class AsObjectModel:
    """Annotation that documents a JSON object as any kind of object model."""

    def __get_pydantic_json_schema__(self, _: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """Return the schema for the OpenAPI document."""
        return handler(_ADAPTER.core_schema)


def model_from_json(name: str, value: Mapping[str, Any], where: str | None = None) -> ObjectModel:
    """Return the model of the object `name`; the inverse of `as_json`.

    Args:
        where: path of the model in errors; by default ``object_models[NAME]``.

    Raises:
        InvalidInputError: naming the field below `where`, its value and what is valid.
    """
    try:
        return _ADAPTER.validate_python(value)
    except ValidationError as error:
        raise _refusal(where or f"object_models[{name}]", error.errors()[0]) from None


def _refusal(where: str, error: ErrorDetails) -> InvalidInputError:
    """Return pydantic's error as the service's own, with its naming of fields."""
    kind, value = error["type"], error["input"]
    if not error["loc"]:
        estimator = value.get("estimator") if isinstance(value, Mapping) else None
        return InvalidInputError(f"{where}.estimator", f"is {estimator!r}", ", ".join(MODELS))
    tag, *path = error["loc"]
    within_list = isinstance(path[-1], int) if path else False
    while path and isinstance(path[-1], int) and kind != "dataclass_type":
        path.pop()  # an error of one of three numbers names the vector
    field_name = where + "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    own = error.get("ctx", {}).get("error")
    if isinstance(own, InvalidInputError):
        return within(field_name, own)
    if kind in ("missing", "unexpected_keyword_argument") and not within_list:
        known = ", ".join(_resolved(_documented(tag, path[:-1])).get("properties", {}))
        return InvalidInputError(field_name, "is missing" if kind == "missing" else "is not a field", known)
    expected = error["msg"].removeprefix("Input should be ")
    return InvalidInputError(field_name, f"is {value!r:.80}", _documented(tag, path).get("description", expected))


@cache
def _schema() -> dict[str, Any]:
    return _ADAPTER.json_schema()


def _documented(tag: str | int, path: Sequence[str | int]) -> dict[str, Any]:
    """Return the schema at a path in the models of an estimator."""
    node: dict[str, Any] = {"$ref": _schema()["discriminator"]["mapping"][tag]}
    for part in path:
        node = _resolved(node)
        node = node.get("items", {}) if isinstance(part, int) else node.get("properties", {}).get(part, {})
    return node


def _resolved(node: dict[str, Any]) -> dict[str, Any]:
    """Return the definition to which a schema refers, itself or as its first alternative."""
    for option in (node, *node.get("anyOf", ())):
        if "$ref" in option:
            definition: dict[str, Any] = _schema()["$defs"][option["$ref"].rpartition("/")[2]]
            return definition
    return node
