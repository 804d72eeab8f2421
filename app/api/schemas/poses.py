"""Objects in images: what is asked and answered about them apart from episodes and predictions."""

from typing import Annotated, Any

from pydantic import BaseModel, Field

from app.api.schemas.requests import CameraIn, MaskId, Name, RequestModel
from app.perception.models import AsObjectModel
from app.perception.strict import WHOLE


class LearnBody(RequestModel):
    """What to learn, and from how much."""

    objects: Annotated[list[Name] | None, Field(min_length=1, max_length=64, description="null: all of the task")] = (
        None
    )
    episodes: Annotated[int, Field(ge=1, le=100, description="at most so many, the task's first"), WHOLE] = 10


class TryModelBody(RequestModel):
    """An object model, and the episodes in whose images it is to find the object."""

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
