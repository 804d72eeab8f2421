"""Labels: views of an object with its masks, and what is learned from them."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import BaseModel, Field

from app.api.schemas.requests import CameraIn, MaskId, Name, RequestModel
from app.perception.models import AsObjectModel
from app.perception.registered.model import Symmetric
from app.perception.strict import Number, Truth

Pixel = Annotated[tuple[Number, Number], Field(description="[x, y] = [column, row]")]


class LabelBody(RequestModel):
    """Where an object is in the images of an episode, or in images of its own.

    Give one of: `clicks`, from which masks grow in every camera; `polygons`; parts `mask_NAME`; or `mask_ids` of the
    mask images that the episode has, which may be left out where the episode says them.
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
        dict[str, Pixel], Field(default_factory=dict, max_length=16, description="by camera a pixel of the object")
    ]
    polygons: Annotated[
        dict[str, Annotated[list[Pixel], Field(max_length=1000)]],
        Field(default_factory=dict, max_length=16, description="by camera three or more corners around the object"),
    ]
    yaw_deg: Annotated[
        Number | None,
        Field(ge=-360, le=360, description="of its x axis about the vertical, to within ten degrees; null: searched"),
    ] = None


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


class LearnedLabelsOut(BaseModel):
    """What was learned of an object: its model, which the task now has."""

    object: str
    model: Annotated[dict[str, Any], AsObjectModel()]
    advice: Annotated[str, Field(description="what would make it surer; empty if nothing")]
