"""Objects' poses for whoever asks, apart from any task: what `POST /poses` offers to other instances."""

from collections.abc import Sequence

from app.perception.base import ObjectQuery
from app.perception.models import model_from_json
from app.perception.object_model import ObjectModel
from app.perception.poses_wire import PoseQuestion
from app.perception.registry import estimate_poses
from app.perception.remote_model import RemoteModel
from app.pipeline.camera import RgbdFrame
from app.pipeline.episode import ObjectPose
from app.pipeline.errors import InvalidInputError
from app.pipeline.prompt import check_object_names

REMEDY = 'an object model, e.g. {"estimator": "cuboid", "size_m": [0.05, 0.05, 0.05], "color": "red"}, or mask_ids'


def find_poses(questions: Sequence[PoseQuestion], frames: Sequence[RgbdFrame]) -> tuple[ObjectPose, ...]:
    """One pose per question, in their order; objects without a model are found by their masks.

    Raises:
        as PoseEstimator.estimate; InvalidInputError for a model that is not valid, or is for a further server.
    """
    names = [question.name for question in questions]
    check_object_names(names, list(dict.fromkeys(names)))
    queries = [ObjectQuery(item.name, mask_ids=item.mask_ids, model=_model(item)) for item in questions]
    return estimate_poses("masks", queries, frames)


def _model(question: PoseQuestion) -> ObjectModel | None:
    where = f"objects[{question.name}].model"
    if question.model is None:
        if not question.mask_ids:
            raise InvalidInputError(where, "is missing", REMEDY)
        return None
    try:
        model = model_from_json(question.name, question.model)
    except InvalidInputError as error:
        field = error.field.replace(f"object_models[{question.name}]", where, 1)
        raise InvalidInputError(field, error.message, error.valid) from None
    if isinstance(model, RemoteModel):
        # a server that asked on could be sent round in circles
        raise InvalidInputError(f"{where}.estimator", "is 'remote'", "cuboid, markers, masks")
    return model
