"""A scene as pages show it; world frame, meters.

For `static/scene3d.js` a document of workspace, path, end-effector frames and objects; where no camera's picture was
sent, a small drawing of the poses, of which the template makes SVG. Objects have the color that their names say.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.overlay import PALETTE
from app.pipeline.order.vocabulary import COLORS
from app.services.setting_parts import WorkspaceSettings
from app.store.records import PredictionSummary
from app.store.values import JsonObject, ObjectRecord
from roboprompt_client.types.arrays import Array

MAX_PATH_POINTS = 2000
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
