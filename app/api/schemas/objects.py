"""Objects in images: what is asked and answered about them, and learned from them."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, Field

from app.api.schemas import examples
from app.api.schemas.requests import CameraIn, MaskId, Name, RequestModel
from app.perception.models import AsObjectModel
from app.perception.registered.model import Symmetric
from app.perception.strict import WHOLE, Number, Truth

Pixel = Annotated[tuple[Number, Number], Field(description="[x, y] = [column, row]")]
Box = Annotated[tuple[Number, Number, Number, Number], Field(description="[left, top, right, bottom]")]


class LearnBody(RequestModel):
    """Objects to learn, and the number of episodes to learn from."""

    model_config = examples.shown(examples.LEARN)

    objects: Annotated[list[Name] | None, Field(min_length=1, max_length=64, description="null: all of the task")] = (
        None
    )
    episodes: Annotated[int, Field(ge=1, le=100, description="at most so many, the task's first"), WHOLE] = 10


class TryModelBody(RequestModel):
    """An object model, and the episodes in whose images it is to find the object."""

    model_config = examples.shown(examples.TRY_MODEL)

    object: Name
    model: Annotated[dict[str, Any], AsObjectModel()]
    episode_ids: Annotated[
        list[Annotated[str, Field(max_length=64)]], Field(min_length=1, max_length=10, description="of the task")
    ]


class PoseQuestionIn(RequestModel):
    """An object to be found: what is known of it, or its ids in the mask images."""

    name: Name
    mask_ids: Annotated[tuple[MaskId, ...], Field(max_length=64, description="ids of its pixels in mask_NAME")] = ()
    model: Annotated[
        Annotated[dict[str, Any], AsObjectModel()] | None,
        Field(description="an object model, as in a task's `object_models`"),
    ] = None


class PosesBody(RequestModel):
    """Objects to be found in images; the images are parts or fields rgb_NAME, depth_NAME and mask_NAME."""

    model_config = examples.shown(examples.POSES)

    objects: Annotated[list[PoseQuestionIn], Field(min_length=1, max_length=64)]
    cameras: Annotated[list[CameraIn], Field(min_length=1, max_length=16)]


class LearnedOut(BaseModel):
    """What was learned of a task's objects."""

    object_models: Annotated[
        dict[str, Annotated[dict[str, Any], AsObjectModel()]], Field(description="as the task now has them, by object")
    ]
    refused: Annotated[
        dict[str, str], Field(description="why nothing was learned of an object; its poses come as before")
    ]
    episode_ids: Annotated[list[str], Field(description="from which was learned")]


class PoseOut(BaseModel):
    """An object's pose in the world frame."""

    name: str
    position: list[float]
    quaternion_xyzw: list[float] | None
    confidence: float
    reason: str
    cameras: list[str]


class RefusalOut(BaseModel):
    """Why an object is not found."""

    message: str
    valid: Annotated[str | None, Field(description="what would help")]


class TriedEpisodeOut(BaseModel):
    """What a model makes of an episode; both null where the episode has no images with color and depth."""

    episode_id: str
    pose: PoseOut | None
    refusal: RefusalOut | None


class TriedModelOut(BaseModel):
    """Where a model finds its object, by episode in their order."""

    episodes: list[TriedEpisodeOut]


class PosesOut(BaseModel):
    """One pose per object, in the order asked."""

    poses: list[PoseOut]


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

    model_config = examples.shown(examples.LABEL)

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


class LabeledCamera(BaseModel):
    """A camera of a label."""

    name: str
    num_pixels: Annotated[int, Field(description="of the object's mask")]


class LabelOut(BaseModel):
    """A labeled view of an object."""

    id: str
    task: str
    object: str
    episode_id: str | None
    cameras: list[LabeledCamera]
    yaw_deg: float | None
    created_at: datetime


class LabelList(BaseModel):
    """A task's labels, the first one first."""

    labels: list[LabelOut]


class LearnLabelsBody(RequestModel):
    """The object to learn from its labels."""

    model_config = examples.shown(examples.LEARN_LABELS)

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
