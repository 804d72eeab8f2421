"""Colours and sizes of objects from demonstrations' first frames, so that nobody has to type them in."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from app.perception.base import ObjectQuery
from app.perception.cuboid import CuboidPoses
from app.perception.cuboid_model import ColorModel, CuboidModel
from app.perception.depth_checks import check_rgbd
from app.perception.labelled_scene import LabelledScene
from app.perception.learn_color import learn_color, object_pixels
from app.perception.learn_relation import learn_away_from, learn_rank, with_shared_looks
from app.perception.learn_shape import Measured, measure
from app.perception.upright_shape import SHAPES, Shape
from app.pipeline.arrays import Array
from app.pipeline.errors import InvalidInputError, ObjectNotVisibleError, UncertainPoseError

ROUND_TO_M = 1e-4
EQUAL_SIDES_SHARE, EQUAL_SIDES_M = 0.06, 0.002  # sides that differ by less are a square's
CENTRED_M = 0.003  # an origin nearer than this to the shape's axis is on it
SAME_M = 0.02  # a pose found nearer than this to the given one is right


def learn_models(scenes: Sequence[LabelledScene]) -> dict[str, CuboidModel]:
    """Models of the objects that the scenes name, for the estimator `cuboid`.

    Each model is tried on the scenes that it was learned from before it is returned.

    Raises:
        InvalidInputError: naming the object and why no model of it can be learned: no colour that stands out, a shape
            that is neither box nor cylinder, several that look alike and no rule that tells them apart.
    """
    if not scenes:
        raise InvalidInputError("episodes", "there is none", "one or more episodes with RGB-D images")
    for frame in (frame for scene in scenes for frame in scene.frames):
        check_rgbd(frame)
    models = {query.name: _learn(query.name, scenes) for query in scenes[0].objects}
    models = {name: learn_rank(name, model, scenes, models) for name, model in models.items()}
    models = {name: with_shared_looks(model, models.values()) for name, model in models.items()}
    _try_out(models, scenes)
    return models


def _learn(name: str, scenes: Sequence[LabelledScene]) -> CuboidModel:
    labelled = [
        (frame, query) for scene in scenes for query in scene.objects if query.name == name for frame in scene.frames
    ]
    seen = [(frame, query, pixels) for frame, query in labelled if (pixels := object_pixels(frame, query)) is not None]
    field = f"object_models[{name}]"
    if not seen:
        raise InvalidInputError(field, "no camera shows it with known depth", "mask_ids or a position in each episode")
    color = learn_color(field, [(frame, pixels) for frame, _, pixels in seen])
    measured = {kind: [measure(*view, color, kind) for view in seen] for kind in SHAPES}
    shape = min(SHAPES, key=lambda kind: sum(item.cost for item in measured[kind] if item is not None))
    items = [item for item in measured[shape] if item is not None]
    if not items:
        raise InvalidInputError(field, "its pixels form no patch of one colour", "a larger view of it")
    return _model(field, name, color, shape, items, scenes)


def _model(
    field: str, name: str, color: ColorModel, shape: Shape, items: Sequence[Measured], scenes: Sequence[LabelledScene]
) -> CuboidModel:
    size_m = _squared(np.median([item.size_m for item in items], axis=0), shape)
    offsets_m = [item.origin_m for item in items if item.origin_m is not None]
    origin_m = np.median(offsets_m, axis=0) if offsets_m else np.zeros(3)
    model = CuboidModel(_rounded(size_m), color, shape, (0.0, 0.0, _rounded(origin_m)[2]))
    if np.hypot(origin_m[0], origin_m[1]) < CENTRED_M:
        return model
    away_from = learn_away_from(name, scenes)
    if away_from is None:
        message = f"its origin is {100 * np.hypot(*origin_m[:2]):.1f} cm off the middle of what has its colour"
        raise InvalidInputError(field, message, "poses in its middle, or markers on it")
    return replace(model, origin_m=_rounded(origin_m), away_from=away_from)


def _squared(size_m: Array, shape: Shape) -> Array:
    """Sides that are nearly equal made equal."""
    x, y, z = size_m
    if shape == "cylinder" or abs(x - y) < max(EQUAL_SIDES_M, EQUAL_SIDES_SHARE * max(x, y)):
        return np.array([(x + y) / 2, (x + y) / 2, z])
    return size_m


def _rounded(vector_m: Array) -> tuple[float, float, float]:
    x, y, z = (float(round(item / ROUND_TO_M) * ROUND_TO_M) for item in vector_m)
    return round(x, 6), round(y, 6), max(round(z, 6), -1.0)


def _try_out(models: Mapping[str, CuboidModel], scenes: Sequence[LabelledScene]) -> None:
    """Find the objects in the scenes again; the models stand if every pose is right."""
    for number, scene in enumerate(scenes):
        queries = [ObjectQuery(query.name, model=models[query.name]) for query in scene.objects]
        try:
            poses = CuboidPoses().estimate(queries, scene.frames)
        except (ObjectNotVisibleError, UncertainPoseError) as error:
            field = error.field.replace("objects", "object_models", 1)
            message = f"what was learned does not find it in episode {number}: {error.message}"
            raise InvalidInputError(field, message, error.valid) from None
        for query, pose in zip(scene.objects, poses, strict=True):
            if query.position_m is None:
                continue
            apart_m = float(np.linalg.norm(pose.position_m - query.position_m))
            if apart_m > SAME_M:
                message = f"is found {100 * apart_m:.1f} cm from its position in episode {number}"
                raise InvalidInputError(f"object_models[{query.name}]", message, "another colour, or markers on it")
