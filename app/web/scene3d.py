"""A scene for `static/scene3d.js`: workspace, path, end-effector frames and objects; world frame, metres."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.services.setting_parts import WorkspaceSettings
from app.store.values import JsonObject, ObjectRecord
from app.web.object_colours import object_colours

MAX_PATH_POINTS = 2000


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
    path_m: npt.NDArray[np.float64] | None = None,
    shown: Iterable[ObjectRecord] = (),
) -> JsonObject:
    """The document that `drawScene` takes.

    Args:
        frames: each made by `frame`, in their order.
        path_m: (T, 3) of the end effector; without one the frames are joined.
        shown: objects as demonstrations have them, drawn faintly.
    """
    objects, shown = tuple(objects), tuple(shown)
    colors = object_colours(item.name for item in (*objects, *shown))
    points = [item["position"] for item in frames] if path_m is None else _thinned(path_m).tolist()
    return {
        "workspace": {"min": workspace.min, "max": workspace.max},
        "path": points,
        "frames": list(frames),
        "objects": [_object(item, colors) for item in objects],
        "shown": [_object(item, colors) for item in shown],
    }


def _object(record: ObjectRecord, colors: Mapping[str, str]) -> JsonObject:
    axes = None if record.quaternion_xyzw is None else _axes(record.quaternion_xyzw)
    return {"label": record.name, "position": record.position_m, "axes": axes, "color": colors[record.name]}


def _axes(quaternion_xyzw: Sequence[float]) -> Any:  # noqa: ANN401
    """The directions of x, y and z, a row each."""
    return Rotation.from_quat(quaternion_xyzw).as_matrix().T.tolist()


def _thinned(path_m: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    step = -(-len(path_m) // MAX_PATH_POINTS)
    return np.concatenate([path_m[::step], path_m[-1:]])
