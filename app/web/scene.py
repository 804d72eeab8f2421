"""A scene as pages show it; world frame, meters.

For `static/scene3d.js` a document of workspace, path, end-effector frames and objects; where no camera's picture was
sent, a small drawing of the poses, of which the template makes SVG. Objects have the color that their names say.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import cycle, product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.overlay import PALETTE
from app.pipeline.order.vocabulary import COLORS
from app.services.setting_parts import WorkspaceSettings
from app.store.records import EpisodeRecord, PredictionSummary
from app.store.values import JsonObject, ObjectRecord
from roboprompt_client.types.arrays import Array

MAX_PATH_POINTS = 2000
WIDTH, HEIGHT, MARGIN = 96.0, 72.0, 8.0  # units of the drawing
AZIMUTH_DEG, ELEVATION_DEG = -47.0, 27.0  # of the viewer, as in static/view3d.js
BOX_M = 0.05
MIN_M = 0.35  # as wide is the drawing at least: a single object does not fill it
_CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
_TURN = Rotation.from_euler("ZY", (AZIMUTH_DEG, -ELEVATION_DEG), degrees=True).as_matrix()
_TOWARDS, _RIGHT, _UP = _TURN.T
_BASIC = {
    "black": "#24292f", "white": "#f0f0f0", "red": "#d1242f", "green": "#2a9d50", "yellow": "#e3b91c",
    "blue": "#2f6fde", "brown": "#8a5a2b", "purple": "#8250df", "pink": "#e36bae", "orange": "#e67e22",
    "grey": "#8c959f",
}  # fmt: skip
_OTHERS = tuple(f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in PALETTE)


def object_colors(names: Iterable[str]) -> dict[str, str]:
    """A color as CSS writes it for each name; no two share one while there are enough."""
    wanted = list(dict.fromkeys(names))
    chosen: dict[str, str] = {}
    for name in wanted:
        if said := [color for color in _said(name) if color not in chosen.values()]:
            chosen[name] = said[0]
    free = cycle([color for color in (*_OTHERS, *_BASIC.values()) if color not in chosen.values()])
    return {name: chosen.get(name) or next(free) for name in wanted}


def _said(name: str) -> list[str]:
    """The colors of the words of the name; a word that may mean several counts for each."""
    words = name.casefold().replace("_", " ").split()
    return [_BASIC[basic] for word in words for basic in sorted(COLORS.get(word, ()))]


def frame(
    label: str, position_m: Sequence[float], quaternion_xyzw: Sequence[float], *, gripper_open: bool
) -> JsonObject:
    """An end-effector pose, drawn as its three axes."""
    axes = _axes(quaternion_xyzw)
    return {"label": label, "position": list(position_m), "axes": axes, "gripper_open": gripper_open}


def scene(
    workspace: WorkspaceSettings,
    objects: Iterable[ObjectRecord],
    frames: Sequence[JsonObject],
    path_m: Array | None = None,
    shown: Iterable[ObjectRecord] = (),
    asked: Iterable[PredictionSummary] = (),
) -> JsonObject:
    """The document that `drawScene` takes.

    Args:
        frames: each made by `frame`, in their order.
        path_m: (T, 3) of the end effector; without one the frames are joined.
        shown: objects as demonstrations have them, drawn faintly.
        asked: predictions; where their objects stood, and how it went.
    """
    objects, shown = tuple(objects), tuple(shown)
    colors = object_colors(item.name for item in (*objects, *shown))
    if path_m is None:
        path = [item["position"] for item in frames]
    else:
        path = np.concatenate([path_m[:: -(-len(path_m) // MAX_PATH_POINTS)], path_m[-1:]]).tolist()
    return {
        "workspace": {"min": workspace.min, "max": workspace.max},
        "path": path,
        "frames": list(frames),
        "objects": [_object(item, colors) for item in objects],
        "shown": [_object(item, colors) for item in shown],
        "asked": [
            {"label": item.name, "position": item.position_m, "fate": prediction.fate, "id": prediction.id}
            for prediction in asked
            for item in prediction.objects
        ],
    }


def _object(record: ObjectRecord, colors: Mapping[str, str]) -> JsonObject:
    axes = None if record.quaternion_xyzw is None else _axes(record.quaternion_xyzw)
    return {"label": record.name, "position": record.position_m, "axes": axes, "color": colors[record.name]}


def _axes(quaternion_xyzw: Sequence[float]) -> Any:  # noqa: ANN401
    """The directions of x, y and z, a row each."""
    return Rotation.from_quat(quaternion_xyzw).as_matrix().T.tolist()


def scene_picture(record: EpisodeRecord) -> JsonObject | None:
    """A small drawing of an episode's first frame and the way through its keyframes; None where there is no object.

    Of the rectangle under the objects, the sides of objects and the way it has the points as SVG writes them; a side
    has a color and a shade (0 is the brightest); a keyframe has x, y and whether the gripper is open.
    """
    if not (objects := record.objects):
        return None
    way = np.array([item.position_m for item in record.keyframes]).reshape(-1, 3)
    places_m = np.array([item.position_m for item in objects])
    (left, front, _), (right, back, _) = places_m.min(axis=0) - 1.6 * BOX_M, places_m.max(axis=0) + 1.6 * BOX_M
    under = places_m[:, 2].min() - BOX_M / 2
    ground = np.array([(left, front, under), (right, front, under), (right, back, under), (left, back, under)])
    to_page = _fit(np.vstack([ground, way]))
    colors = object_colors(item.name for item in objects)
    ordered = sorted(objects, key=lambda item: float(np.dot(item.position_m, _TOWARDS)))
    return {
        "ground": _text(to_page(ground)),
        "faces": [(_text(to_page(side)), colors[item.name], shade) for item in ordered for side, shade in _sides(item)],
        "path": _text(to_page(way)),
        "keyframes": [(x, y, k.gripper_open) for (x, y), k in zip(to_page(way), record.keyframes, strict=True)],
    }


def _fit(points_m: Array) -> Callable[[Array], Array]:
    """World -> page, x to the right and y down, so that all the points of (N, 3) in meters are seen."""
    flat = _flat(points_m)
    low, high = flat.min(axis=0), flat.max(axis=0)
    room = np.array([WIDTH, HEIGHT]) - 2 * MARGIN
    scale = (room / np.maximum(high - low, MIN_M * np.array([1.0, HEIGHT / WIDTH]))).min()
    return lambda points: (np.array([WIDTH, HEIGHT]) / 2 + (_flat(points) - (low + high) / 2) * scale).round(1)


def _text(points: Array) -> str:
    return " ".join(f"{x:g},{y:g}" for x, y in points)


def _flat(points_m: Array) -> Array:
    flat: Array = np.stack([points_m @ _RIGHT, -points_m @ _UP], axis=-1)
    return flat


def _sides(item: ObjectRecord) -> Iterator[tuple[Array, int]]:
    """Yield the corners of the sides of its box that face the viewer, and their shade."""
    turn = np.eye(3) if item.quaternion_xyzw is None else Rotation.from_quat(item.quaternion_xyzw).as_matrix()
    for axis, sign in product(range(3), (-1, 1)):
        normal = sign * turn[:, axis]
        if normal @ _TOWARDS > 0:
            around = _CORNERS[_CORNERS[:, axis] * sign > 0][[0, 1, 3, 2]]
            shade = 0 if normal[2] > abs(normal[:2]).max() else 1 if normal @ _RIGHT > 0 else 2
            yield np.array(item.position_m) + BOX_M * around @ turn.T, shade
