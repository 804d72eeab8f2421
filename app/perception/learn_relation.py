"""How where other objects are distinguishes an object from its like, and its yaws from each other."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.cuboid import likenesses
from app.perception.cuboid_model import CuboidModel, Rank
from app.perception.labelled_scene import LabelledScene
from app.pipeline.arrays import Array
from app.pipeline.errors import InvalidInputError

MAX_MEAN_ANGLE_DEG = 20.0
STEADY = 0.8  # of the scenes agree on the rank: in the others two are equally near


def learn_away_from(name: str, scenes: Sequence[LabelledScene]) -> str | None:
    """The object that the x axis of `name` points away from in all scenes; None if there is none."""
    angles: dict[str, list[float]] = {}
    for scene in scenes:
        poses = {query.name: query for query in scene.objects}
        query = poses.get(name)
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


def learn_rank(
    name: str, model: CuboidModel, scenes: Sequence[LabelledScene], models: Mapping[str, CuboidModel]
) -> CuboidModel:
    """The model with a rank if several things look like it.

    Raises:
        InvalidInputError: if nothing tells them apart in the same way in all scenes.
    """
    ranks: dict[str, list[int]] = {}
    most = 1
    for scene in scenes:
        query = next(query for query in scene.objects if query.name == name)
        places_m = likenesses(model, scene.frames)
        most = max(most, len(places_m))
        if query.position_m is None or not places_m:
            continue
        for other, anchor_m in _others(scene, name):
            ranks.setdefault(other, []).append(_rank_of(np.array(query.position_m), places_m, anchor_m))
    if most == 1:
        return model
    steady = {
        other: mode
        for other, seen in ranks.items()
        if not _alike(models[other], model) and seen.count(mode := max(set(seen), key=seen.count)) >= STEADY * len(seen)
    }
    if not steady:
        message = f"up to {most} things look like it, and their order from no other object is the same in all episodes"
        raise InvalidInputError(f"object_models[{name}]", message, "colours of their own, or markers")
    anchor, number = next(iter(steady.items()))
    return replace(model, rank=Rank(number, anchor, most))


def with_shared_looks(model: CuboidModel, models: Iterable[CuboidModel]) -> CuboidModel:
    """The model with size and colour of the first of those that it is counted among: they are looked for once."""
    if model.rank is None:
        return model
    first = next(other for other in models if other.rank is not None and _alike(other, model))
    return replace(model, size_m=first.size_m, color=first.color, shape=first.shape)


def _rank_of(position_m: Array, places_m: Sequence[Array], anchor_m: Array) -> int:
    """Which of the places, counted from the anchor, is the one at the position."""
    nearest_first = sorted(places_m, key=lambda place: float(np.linalg.norm(place - anchor_m)))
    own = min(range(len(nearest_first)), key=lambda k: float(np.linalg.norm(nearest_first[k] - position_m)))
    return own + 1


def _alike(one: CuboidModel, other: CuboidModel) -> bool:
    """Whether an object cannot be the anchor since it has to be distinguished from its like itself."""
    middle = [
        (model.color.hue_deg[0] + ((model.color.hue_deg[1] - model.color.hue_deg[0]) % 360) / 2)
        for model in (one, other)
    ]
    return abs((middle[0] - middle[1] + 180) % 360 - 180) < 10 and np.allclose(one.size_m, other.size_m, rtol=0.2)


def _others(scene: LabelledScene, name: str) -> Iterator[tuple[str, Array]]:
    for query in scene.objects:
        if query.name != name and query.position_m is not None:
            yield query.name, np.array(query.position_m)
