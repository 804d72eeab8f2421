"""Labels: views of an object with its masks, and what is learned from them."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, Field

from app.api.schemas.requests import CameraIn, MaskId, Name, RequestModel
from app.perception.models import AsObjectModel
from app.perception.registered.model import Symmetric
from app.perception.strict import Number, Truth

Pixel = Annotated[tuple[Number, Number], Field(description="[x, y] = [column, row]")]


Box = Annotated[tuple[Number, Number, Number, Number], Field(description="[left, top, right, bottom]")]


def _several(value: object) -> object:
    """A lone pixel as a list of one."""
    is_pixel = isinstance(value, list | tuple) and value and not isinstance(value[0], list | tuple)
    return [value] if is_pixel else value


Pixels = Annotated[
    list[Pixel], Field(max_length=32), BeforeValidator(_several, json_schema_input_type=Pixel | list[Pixel])
]


class LabelBody(RequestModel):
    """Where an object is in the images of an episode, or in images of its own.

    Give one of: `clicks` or `boxes`, from which masks grow in every camera; `polygons`; parts `mask_NAME`; or
    `mask_ids` of the mask images that the episode has, which may be left out where the episode says them.
    """

    object: Name
    episode_id: Annotated[
        str | None, Field(max_length=64, description="whose first images they are; null: those sent with `cameras`")
    ] = None
    cameras: Annotated[
        list[CameraIn],
        Field(default_factory=list, max_length=16, description="of images sent as parts rgb_NAME, depth_NAME"),
    ]
    mask_ids: Annotated[tuple[MaskId, ...], Field(max_length=64, description="ids of its pixels in mask images")] = ()
    clicks: Annotated[
        dict[str, Pixels],
        Field(default_factory=dict, max_length=16, description="by camera a pixel of the object, or several"),
    ]
    clicks_off: Annotated[
        dict[str, Pixels],
        Field(default_factory=dict, max_length=16, description="by camera pixels of what is not the object"),
    ]
    boxes: Annotated[
        dict[str, Box], Field(default_factory=dict, max_length=16, description="by camera a box around the object")
    ]
    polygons: Annotated[
        dict[str, Annotated[list[Pixel], Field(max_length=1000)]],
        Field(default_factory=dict, max_length=16, description="by camera three or more corners around the object"),
    ]
    yaw_deg: Annotated[
        Number | None,
        Field(ge=-360, le=360, description="of its x axis about the vertical, to within ten degrees; null: searched"),
    ] = None

    arrows: Annotated[
        dict[str, tuple[Pixel, Pixel]],
        Field(
            default_factory=dict,
            max_length=1,
            description="by camera tail and head of an arrow along the object's x axis, in place of yaw_deg",
        ),
    ]


class PreviewedCamera(BaseModel):
    """A camera of a preview."""

    name: str
    num_pixels: Annotated[int, Field(description="of the object's mask")]
    outlines: Annotated[
        list[list[tuple[float, float]]], Field(description="of the mask: corners [x, y]; one within another is a hole")
    ]


class LabelPreviewOut(BaseModel):
    """What a label would say."""

    cameras: list[PreviewedCamera]
    yaw_deg: float | None


class LabelledCamera(BaseModel):
    """A camera of a label."""

    name: str
    num_pixels: Annotated[int, Field(description="of the object's mask")]


class LabelOut(BaseModel):
    """A labelled view of an object."""

    id: str
    task: str
    object: str
    episode_id: str | None
    cameras: list[LabelledCamera]
    yaw_deg: float | None
    created_at: datetime


class LabelList(BaseModel):
    """A task's labels, the first one first."""

    labels: list[LabelOut]


class LearnLabelsBody(RequestModel):
    """Which object to learn."""

    object: Name
    symmetric: Symmetric = "none"
    yaw_may_be_unknown: Annotated[
        Truth, Field(description="give a pose without rotation where the images do not decide the yaw")
    ] = False

    dry_run: Annotated[Truth, Field(description="answer the model, and leave the task as it is")] = False


class LearnedLabelsOut(BaseModel):
    """What was learned of an object: its model, which the task now has unless it was a dry run."""

    object: str
    model: Annotated[dict[str, Any], AsObjectModel()]
    advice: Annotated[str, Field(description="what would make it surer; empty if nothing")]
