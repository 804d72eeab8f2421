"""Object models of the estimator `cuboid`, learned from the first frames of demonstrations.

Besides color, size and shape a model may refer to other objects: to the one whose distance distinguishes similar
objects (`Rank`), and to the one that the object's x axis points away from.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.base import LabeledScene, ObjectQuery
from app.perception.cuboid.appearance import MeasuredShape, learn_color, measure, object_pixels
from app.perception.cuboid.estimator import CuboidPoses, likenesses
from app.perception.cuboid.model import SHAPES, ColorModel, CuboidModel, Rank, Shape
from app.perception.frame_checks import check_rgbd
from app.perception.object_model import ObjectModelError
from app.pipeline.errors import NoPoseError
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array

MAX_MEAN_ANGLE_DEG = 20.0
STEADY = 0.8  # share of scenes that must agree on the rank: in others two distances may be equal
ROUND_TO_M = 1e-4
EQUAL_SIDES_SHARE, EQUAL_SIDES_M = 0.06, 0.002  # sides that differ by less are a square's
CENTERED_M = 0.003  # an origin nearer than this to the shape's axis is on it
MAX_TURN_DEG = 15.0  # between the given rotations of an object that is taken for round
SAME_M = 0.02  # a pose found nearer than this to the given one is right
SAME_HUE_DEG, SAME_SIZE = 10.0, 0.2  # objects of smaller differences in hue and relative size look alike


def learn_models(
    scenes: Sequence[LabeledScene], yaw_symmetry_deg: Mapping[str, float] | None = None
) -> dict[str, CuboidModel]:
    """Return models for the estimator `cuboid` of the objects in the scenes.

    Each model is tested on the scenes from which it was learned.

    Args:
        yaw_symmetry_deg: of objects with a known symmetry, as for `canonical_pose`.

    Raises:
        InvalidInputError: naming the object and why no model of it can be learned: no color that stands out, a shape
            that is neither box nor cylinder, several that look alike and no rule that tells them apart.
    """
    if not scenes:
        raise InvalidInputError("episodes", "there is none", "one or more episodes with RGB-D images")
    for frame in (frame for scene in scenes for frame in scene.frames):
        check_rgbd(frame)
    models = {query.name: _learn(query.name, scenes) for query in scenes[0].objects}
    models = {name: _with_rank(name, model, scenes, models) for name, model in models.items()}
    models = {name: _with_shared_looks(model, models.values()) for name, model in models.items()}
    for name, model in models.items():
        if model.shape == "cylinder" and name not in (yaw_symmetry_deg or {}):
            _check_round(name, scenes)
    _try_out(models, scenes)
    return models


def _learn(name: str, scenes: Sequence[LabeledScene]) -> CuboidModel:
    labeled = [
        (frame, query) for scene in scenes for query in scene.objects if query.name == name for frame in scene.frames
    ]
    seen = [(frame, query, pixels) for frame, query in labeled if (pixels := object_pixels(frame, query)).any()]
    if not seen:
        raise ObjectModelError(name, "no camera shows it with known depth", "mask_ids or a position in each episode")
    color = learn_color(name, [(frame, pixels) for frame, _, pixels in seen])
    measured = {kind: [measure(*view, color, kind) for view in seen] for kind in SHAPES}
    shape = min(SHAPES, key=lambda kind: sum(item.cost for item in measured[kind] if item is not None))
    items = [item for item in measured[shape] if item is not None]
    if not items:
        raise ObjectModelError(name, "its pixels form no patch of one color", "a larger view of it")
    return _model(name, color, shape, items, scenes)


def _model(
    name: str, color: ColorModel, shape: Shape, items: Sequence[MeasuredShape], scenes: Sequence[LabeledScene]
) -> CuboidModel:
    x, y, z = np.median([item.size_m for item in items], axis=0)
    if shape == "cylinder" or abs(x - y) < max(EQUAL_SIDES_M, EQUAL_SIDES_SHARE * max(x, y)):
        x = y = (x + y) / 2
    offsets_m = [item.origin_m for item in items if item.origin_m is not None]
    origin_m = np.median(offsets_m, axis=0) if offsets_m else np.zeros(3)
    model = CuboidModel(_rounded((x, y, z)), color, shape, (0.0, 0.0, _rounded(origin_m)[2]))
    off_axis_m = np.hypot(*origin_m[:2])
    if off_axis_m < CENTERED_M:
        return model
    away_from = _away_from(name, scenes)
    if away_from is None:
        message = f"its origin is {100 * off_axis_m:.1f} cm off the middle of what has its color"
        raise ObjectModelError(name, message, "poses in its middle, or markers on it")
    return replace(model, origin_m=_rounded(origin_m), away_from=away_from)


def _rounded(vector_m: Iterable[float]) -> tuple[float, float, float]:
    x, y, z = (float(round(item / ROUND_TO_M) * ROUND_TO_M) for item in vector_m)
    return round(x, 6), round(y, 6), max(round(z, 6), -1.0)


def _away_from(name: str, scenes: Sequence[LabeledScene]) -> str | None:
    """Return the object that the x axis of `name` points away from in all scenes, or None."""
    angles: dict[str, list[float]] = {}
    for scene in scenes:
        query = next((query for query in scene.objects if query.name == name), None)
        if query is None or query.quaternion_xyzw is None:
            return None
        heading = Rotation.from_quat(query.quaternion_xyzw).apply([1.0, 0.0, 0.0])[:2]
        for other, place_m in _others(scene, name):
            away = np.array(query.position_m)[:2] - place_m[:2]
            cosine = away @ heading / (np.linalg.norm(away) * np.linalg.norm(heading) + 1e-12)
            angles.setdefault(other, []).append(float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))))
    means = {other: float(np.mean(found)) for other, found in angles.items() if len(found) == len(scenes)}
    best = min(means, key=means.__getitem__, default=None)
    return best if best is not None and means[best] < MAX_MEAN_ANGLE_DEG else None


def _others(scene: LabeledScene, name: str) -> Iterator[tuple[str, Array]]:
    for query in scene.objects:
        if query.name != name and query.position_m is not None:
            yield query.name, np.array(query.position_m)


def _with_rank(
    name: str, model: CuboidModel, scenes: Sequence[LabeledScene], models: Mapping[str, CuboidModel]
) -> CuboidModel:
    """Return the model, with a rank if several objects look like it."""
    ranks: dict[str, list[int]] = {}
    most = 1
    for scene in scenes:
        query = next(query for query in scene.objects if query.name == name)
        places_m = likenesses(model, scene.frames)
        most = max(most, len(places_m))
        if query.position_m is None or not places_m:
            continue
        off_m = np.linalg.norm(np.array(places_m) - query.position_m, axis=1)
        for other, anchor_m in _others(scene, name):
            far_m = np.linalg.norm(np.array(places_m) - anchor_m, axis=1)
            nearest_first = np.argsort(far_m, kind="stable")
            ranks.setdefault(other, []).append(int(np.argmin(off_m[nearest_first])) + 1)
    if most == 1:
        return model
    steady = {
        other: mode
        for other, seen in ranks.items()
        if not _alike(models[other], model) and seen.count(mode := max(set(seen), key=seen.count)) >= STEADY * len(seen)
    }
    if not steady:
        message = f"up to {most} things look like it, and their order from no other object is the same in all episodes"
        raise ObjectModelError(name, message, "colors of their own, or markers")
    anchor, number = next(iter(steady.items()))
    return replace(model, rank=Rank(number, anchor, most))


def _with_shared_looks(model: CuboidModel, models: Iterable[CuboidModel]) -> CuboidModel:
    """Return the model with size and color of the first that looks like it, so that one search finds all of them."""
    if model.rank is None:
        return model
    first = next(other for other in models if other.rank is not None and _alike(other, model))
    return replace(model, size_m=first.size_m, color=first.color, shape=first.shape)


def _alike(one: CuboidModel, other: CuboidModel) -> bool:
    """Return whether two objects look too similar for one to be the reference of the other's rank."""
    hues_deg = [low + (high - low) % 360 / 2 for low, high in (one.color.hue_deg, other.color.hue_deg)]
    apart_deg = abs((hues_deg[0] - hues_deg[1] + 180) % 360 - 180)
    return apart_deg < SAME_HUE_DEG and np.allclose(one.size_m, other.size_m, rtol=SAME_SIZE)


def _check_round(name: str, scenes: Sequence[LabeledScene]) -> None:
    """Refuse a cylinder for an object that was given with different yaws: the model would ignore a cup's handle."""
    given = [query.quaternion_xyzw for scene in scenes for query in scene.objects if query.name == name]
    rotations = [Rotation.from_quat(quaternion) for quaternion in given if quaternion is not None]
    turn_deg = max((float(np.degrees((rotations[0].inv() * other).magnitude())) for other in rotations), default=0.0)
    if turn_deg > MAX_TURN_DEG:
        message = f"is round without its yaw, and its given yaws differ by up to {turn_deg:.0f} degrees"
        raise ObjectModelError(name, message, "yaw_symmetry_deg 0 if it is round; else labels, for `registered`")


def _try_out(models: Mapping[str, CuboidModel], scenes: Sequence[LabeledScene]) -> None:
    """Find the objects in the scenes again; raise ObjectModelError if one is not found or off its given position."""
    for number, scene in enumerate(scenes):
        queries = [ObjectQuery(query.name, model=models[query.name]) for query in scene.objects]
        try:
            poses = CuboidPoses().estimate(queries, scene.frames)
        except NoPoseError as error:
            message = f"what was learned does not find it in episode {number}: {error.message}"
            raise ObjectModelError(error.name, message, error.valid) from None
        for query, pose in zip(scene.objects, poses, strict=True):
            if query.position_m is None:
                continue
            apart_m = float(np.linalg.norm(pose.position_m - query.position_m))
            if apart_m > SAME_M:
                message = f"is found {100 * apart_m:.1f} cm from its position in episode {number}"
                raise ObjectModelError(query.name, message, "another color, or markers on it")
