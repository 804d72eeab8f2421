"""Bodies and answers about objects in images: poses, labels, and object models learned from them."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from app.api.schemas import examples
from app.api.schemas.requests import CameraIn, Described, MaskId, Name, RequestModel
from app.api.schemas.responses import PoseOut
from app.perception.base import ObjectQuery
from app.perception.models import AsObjectModel, model_from_json
from app.perception.object_model import WHOLE, Number, Truth
from app.perception.registered.model import Symmetric

Pixel = Annotated[tuple[Number, Number], Field(description="[x, y] = [column, row]")]
Box = Annotated[tuple[Number, Number, Number, Number], Field(description="[left, top, right, bottom]")]


class LearnBody(RequestModel):
    """Objects to learn, and the number of episodes to learn from."""

    model_config = examples.shown(examples.LEARN)

    objects: Annotated[list[Name] | None, Field(min_length=1, max_length=64)] = None
    """null: all objects of the task"""
    episodes: Annotated[int, Field(ge=1, le=100), WHOLE] = 10
    """largest number of episodes to learn from; the task's first are taken"""


class TryModelBody(RequestModel):
    """An object model, and the episodes in whose images it is to find the object."""

    model_config = examples.shown(examples.TRY_MODEL)

    object: Name
    model: Annotated[dict[str, Any], AsObjectModel()]
    episode_ids: Annotated[list[Annotated[str, Field(max_length=64)]], Field(min_length=1, max_length=10)]
    """ids of episodes of the task"""


class PoseQuestionIn(RequestModel):
    """An object to be found, by an object model or by its ids in the mask images."""

    name: Name
    mask_ids: Annotated[tuple[MaskId, ...], Field(max_length=64)] = ()
    """ids of the object's pixels in mask_NAME"""
    model: Annotated[dict[str, Any], AsObjectModel()] | None = None
    """an object model, as in a task's `object_models`"""

    def query(self) -> ObjectQuery:
        """Return the object as a query for a pose estimator; raise InvalidInputError for an invalid model."""
        where = f"objects[{self.name}].model"
        model = None if self.model is None else model_from_json(self.name, self.model, where)
        return ObjectQuery(self.name, mask_ids=self.mask_ids, model=model)


class PosesBody(RequestModel):
    """Objects to be found in images; the images are parts or fields rgb_NAME, depth_NAME and mask_NAME."""

    model_config = examples.shown(examples.POSES)

    objects: Annotated[list[PoseQuestionIn], Field(min_length=1, max_length=64)]
    cameras: Annotated[list[CameraIn], Field(min_length=1, max_length=16)]


class LearnedOut(Described):
    """The object models that were learned."""

    object_models: dict[str, Annotated[dict[str, Any], AsObjectModel()]]
    """all object models that the task now has, by object name"""
    refused: dict[str, str]
    """by object name, the reason why no model was learned; its poses are found as before"""
    episode_ids: list[str]
    """ids of the episodes that were learned from"""


class RefusalOut(Described):
    """The reason why an object was not found."""

    message: str
    valid: str | None
    """what would help to find it"""


class TriedEpisodeOut(Described):
    """The pose found in an episode, or the reason why none was; both are null without color and depth images."""

    episode_id: str
    pose: PoseOut | None
    refusal: RefusalOut | None


class TriedModelOut(Described):
    """Where a model finds its object, in the order of the episode ids."""

    episodes: list[TriedEpisodeOut]


class PosesOut(Described):
    """One pose per object, in the order of the request."""

    poses: list[PoseOut]


def _several(value: object) -> object:
    """Return a single pixel as a list of one."""
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
    episode_id: Annotated[str | None, Field(max_length=64)] = None
    """episode whose first images are labeled; null: the images sent with `cameras`"""
    cameras: Annotated[list[CameraIn], Field(default_factory=list, max_length=16)]
    """cameras of the images that are sent as parts rgb_NAME, depth_NAME"""
    mask_ids: Annotated[tuple[MaskId, ...], Field(max_length=64)] = ()
    """ids of the object's pixels in mask images"""
    clicks: Annotated[dict[str, Pixels], Field(default_factory=dict, max_length=16)]
    """by camera name: one or more pixels on the object"""
    clicks_off: Annotated[dict[str, Pixels], Field(default_factory=dict, max_length=16)]
    """by camera name: pixels that are not on the object"""
    boxes: Annotated[dict[str, Box], Field(default_factory=dict, max_length=16)]
    """by camera name: a box around the object"""
    polygons: Annotated[
        dict[str, Annotated[list[Pixel], Field(max_length=1000)]], Field(default_factory=dict, max_length=16)
    ]
    """by camera name: a polygon around the object, three or more corners"""
    yaw_deg: Annotated[Number | None, Field(ge=-360, le=360)] = None
    """yaw of the object's x axis, accurate to ten degrees; null: it is searched for"""

    arrows: Annotated[dict[str, tuple[Pixel, Pixel]], Field(default_factory=dict, max_length=1)]
    """by camera name: tail and head of an arrow along the object's x axis, instead of yaw_deg"""


class LabeledCamera(Described):
    """The size of a label's mask in one camera."""

    name: str
    num_pixels: int
    """size of the object's mask, pixels"""


class PreviewedCamera(LabeledCamera):
    """The mask that a label would have in one camera."""

    outlines: list[list[tuple[float, float]]]
    """polygons around the mask, corners [x, y]; a polygon inside another is a hole"""


class LabelPreviewOut(Described):
    """The label that would be stored."""

    cameras: list[PreviewedCamera]
    yaw_deg: float | None


class LabelOut(Described):
    """A labeled view of an object."""

    id: str
    task: str
    object: str
    episode_id: str | None
    cameras: list[LabeledCamera]
    yaw_deg: float | None
    created_at: datetime


class LabelList(Described):
    """A task's labels, oldest first."""

    labels: list[LabelOut]


class LearnLabelsBody(RequestModel):
    """The object to learn from its labels."""

    model_config = examples.shown(examples.LEARN_LABELS)

    object: Name
    symmetric: Symmetric = "none"
    yaw_may_be_unknown: Truth = False
    """true: answer a pose without rotation if the images do not determine the yaw"""

    dry_run: Truth = False
    """true: answer the model and leave the task unchanged"""


class LearnedLabelsOut(Described):
    """The learned object model. The task now has it, unless it was a dry run."""

    object: str
    model: Annotated[dict[str, Any], AsObjectModel()]
    advice: str
    """what would make the model more reliable; empty if nothing"""
