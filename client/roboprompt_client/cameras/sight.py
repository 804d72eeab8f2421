"""What the cameras see, as tables of text and as a page: the table top in each picture, and the objects' poses."""

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from html import escape
from typing import Any, NamedTuple

import numpy as np

from roboprompt_client.cameras.table import FlatSurface, find_flat_surface
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.extras import import_extra
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.quaternions import to_matrix, yaw_rad

MAX_TILT_DEG, MAX_APART_M = 1.0, 0.006  # of the table; a calibrated camera's is within 0.3 degrees and 2 mm
TABLE_DEG = 40.0  # a steeper plane is a wall
CAMERA_COLUMNS = ("camera", "pixels", "depth known", "middle depth", "table")
OBJECT_COLUMNS = ("object", "position, m", "yaw", "confidence", "seen by")
AXIS_M = 0.05
AXIS_COLORS = ("#e5342b", "#2b9e3f", "#2f6fe4")
STYLE = (
    "body{font:15px/1.5 system-ui,sans-serif;margin:2em}svg{width:100%;max-width:640px;display:block}"
    "text{font:600 14px system-ui,sans-serif;paint-order:stroke;stroke:#000;stroke-width:3px;fill:#fff}"
    "figure{display:inline-block;margin:0 1em 1em 0;width:min(100%,480px)}"
)


class SeenObject(NamedTuple):
    """The result of looking for an object: its pose, or None and the problem."""

    name: str
    pose: ObjectPose | None
    problem: str


@dataclass(frozen=True)
class Sight:
    """What the cameras see at one moment; `tables` has one item for each frame."""

    frames: tuple[RgbdFrame, ...]
    tables: tuple[FlatSurface | None, ...]
    objects: tuple[SeenObject, ...]

    @classmethod
    def of(
        cls, client: RoboPromptClient, frames: Sequence[RgbdFrame], object_models: Mapping[str, Mapping[str, Any]]
    ) -> "Sight":
        """Return what the frames show, objects found by the service; raises ServiceUnreachableError if it is away."""
        surfaces = [find_flat_surface(frame) for frame in frames]
        tables = tuple(None if item is None or item.tilt_deg > TABLE_DEG else item for item in surfaces)
        return cls(tuple(frames), tables, tuple(_find(client, frames, *item) for item in object_models.items()))

    def doubts(self) -> list[str]:
        """Return the signs that a camera is not where its pose says: it was bumped, or its calibration is wrong."""
        doubts = []
        seen = [(frame, table) for frame, table in zip(self.frames, self.tables, strict=True) if table is not None]
        for frame, table in seen:
            name = frame.camera.name
            if table.is_above_the_camera:
                doubts.append(f"{name}: the table would be above the camera: does its pose have OpenGL axes?")
            elif table.tilt_deg > MAX_TILT_DEG:
                doubts.append(f"{name}: the table is tilted by {table.tilt_deg:.1f} degrees: calibrate it again")
        if len(seen) > 1:
            place_m = np.mean([table.middle_m for _, table in seen], axis=0)
            heights_m = np.array([table.height_m(place_m) for _, table in seen])
            if np.ptp(heights_m) > MAX_APART_M:
                off_mm = np.rint(1000 * (heights_m - np.median(heights_m))).astype(int)
                named = zip([frame.camera.name for frame, _ in seen], off_mm, strict=True)
                listed = ", ".join(f"{name} {off:+d} mm" for name, off in named)
                doubts.append(f"the cameras disagree on the table's height: {listed}: calibrate them again")
        return doubts

    def camera_rows(self) -> list[tuple[str, ...]]:
        """Return a table of the cameras, starting with its header."""
        return [CAMERA_COLUMNS, *map(_camera_row, self.frames, self.tables)]

    def object_rows(self) -> list[tuple[str, ...]]:
        """Return a table of the objects, starting with its header; for a missing one it has the reason."""
        return [OBJECT_COLUMNS, *map(_object_row, self.objects)]


def _find(client: RoboPromptClient, frames: Sequence[RgbdFrame], name: str, model: Mapping[str, Any]) -> SeenObject:
    """Return where the object is, or why it is not found, and whether it is with red and blue exchanged."""
    try:
        return SeenObject(name, client.find_poses(frames, {name: model})[0], "")
    except ServiceProblemError as error:
        problem = str(error.problem.get("detail") or error)
    swapped = [replace(frame, rgb=frame.rgb[..., ::-1].copy()) for frame in frames if frame.rgb is not None]
    with suppress(ServiceProblemError):
        client.find_poses(swapped, {name: model})
        problem += "; it is found with red and blue swapped: the camera's driver has them in the wrong order"
    return SeenObject(name, None, problem)


def _camera_row(frame: RgbdFrame, table: FlatSurface | None) -> tuple[str, ...]:
    size = "none" if frame.rgb is None else "{1}x{0}".format(*frame.rgb.shape)
    known = middle = "no depth"
    if frame.depth_m is not None:
        measured_m = frame.depth_m[frame.depth_m > 0]
        known = f"{measured_m.size / frame.depth_m.size:.0%}"
        middle = f"{np.median(measured_m):.3f} m" if measured_m.size else "none"
    level = "none" if table is None else f"at {round(table.middle_m[2], 3) + 0:.3f} m, tilted by {table.tilt_deg:.1f}°"
    return frame.camera.name, size, known, middle, level


def _object_row(found: SeenObject) -> tuple[str, ...]:
    pose = found.pose
    if pose is None:
        return found.name, "NOT FOUND", found.problem
    place = " ".join(f"{value:.3f}" for value in pose.position_m)
    yaw = "unknown" if pose.quaternion_xyzw is None else f"{np.degrees(yaw_rad(pose.quaternion_xyzw)):.0f}°"
    return found.name, place, yaw, f"{pose.confidence:.2f}", ", ".join(pose.cameras)


def sight_page(sight: Sight, said: str) -> str:
    """Return an HTML page: the pictures with the objects drawn in, and what was said of them as text.

    Raises:
        InvalidInputError: if OpenCV, which encodes the pictures, is not installed.
    """
    figures = "".join(_figure(frame, [found.pose for found in sight.objects if found.pose]) for frame in sight.frames)
    head = f'<meta charset="utf-8"><title>What the cameras see</title><style>{STYLE}</style>'
    title = "<h1>What the cameras see</h1>"
    return f'<!doctype html><html lang="en">{head}{title}{figures}<pre>{escape(said)}</pre></html>\n'


def _figure(frame: RgbdFrame, poses: Iterable[ObjectPose]) -> str:
    if frame.rgb is None:
        return ""
    height_px, width_px = frame.rgb.shape[:2]
    png = import_extra("cv2", "opencv-python-headless", "images").imencode(".png", frame.rgb[..., ::-1])[1].tobytes()
    address = f"data:image/png;base64,{b64encode(png).decode()}"
    picture = f'<image href="{address}" width="{width_px}" height="{height_px}"/>'
    drawn = f'<svg viewBox="0 0 {width_px} {height_px}">{picture}{"".join(_mark(frame, pose) for pose in poses)}</svg>'
    return f"<figure>{drawn}<figcaption>{escape(frame.camera.name)}</figcaption></figure>"


def _mark(frame: RgbdFrame, pose: ObjectPose) -> str:
    """Return SVG of the object's name and, if its rotation is known, its axes; empty if it is behind the camera."""
    rotation = np.eye(3) if pose.quaternion_xyzw is None else to_matrix(pose.quaternion_xyzw)
    pixels, depth_m = frame.camera.project(np.vstack([pose.position_m, pose.position_m + AXIS_M * rotation.T]))
    if (depth_m <= 0).any():
        return ""
    (x, y), *tips = (pixels + 0.5).round(1).tolist()  # SVG counts from pixel corners, a camera from pixel centers
    axes = "".join(
        f'<line x1="{x}" y1="{y}" x2="{u}" y2="{v}" stroke="{color}" stroke-width="3"/>'
        for (u, v), color in zip(() if pose.quaternion_xyzw is None else tips, AXIS_COLORS, strict=False)
    )
    dot = f'<circle cx="{x}" cy="{y}" r="5" fill="none" stroke="#fff" stroke-width="2"/>'
    return f'{axes}{dot}<text x="{x + 9}" y="{y - 9}">{escape(pose.name)}</text>'
