"""What the cameras see: their pictures, the table in each, and where the service finds the objects."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from roboprompt_client.camera import RgbdFrame
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.flat_surface import FlatSurface, find_flat_surface
from roboprompt_client.quaternions import yaw_rad
from roboprompt_client.trajectory import ObjectPose

MAX_TILT_DEG, MAX_APART_M = 1.0, 0.006  # of the table; a calibrated camera's is within 0.3 degrees and 2 mm
TABLE_DEG = 40.0  # what is steeper is a wall
CAMERA_COLUMNS = ("camera", "pixels", "depth known", "middle depth", "table")
OBJECT_COLUMNS = ("object", "position, m", "yaw", "confidence", "seen by")


@dataclass(frozen=True)
class Found:
    """An object that was looked for.

    Attributes:
        pose: None if it was not found.
        problem: why not.
    """

    name: str
    pose: ObjectPose | None
    problem: str


@dataclass(frozen=True)
class Sight:
    """What the cameras see at one moment."""

    frames: tuple[RgbdFrame, ...]
    tables: tuple[FlatSurface | None, ...]  # one a frame
    objects: tuple[Found, ...]

    def doubts(self) -> list[str]:
        """What says that a camera is not where its pose says: it was bumped, or calibrated wrongly."""
        doubts = []
        seen = [(frame, table) for frame, table in zip(self.frames, self.tables, strict=True) if table is not None]
        for frame, table in seen:
            name = frame.camera.name
            if table.is_above_the_camera:
                doubts.append(f"{name}: the table would lie above it: are the axes of its pose OpenGL's?")
            elif table.tilt_deg > MAX_TILT_DEG:
                doubts.append(f"{name}: the table is tilted by {table.tilt_deg:.1f} degrees: calibrate it again")
        if len(seen) > 1:
            place_m = np.mean([table.middle_m for _, table in seen], axis=0)
            heights_m = np.array([table.height_m(place_m) for _, table in seen])
            if np.ptp(heights_m) > MAX_APART_M:
                off_mm = np.rint(1000 * (heights_m - np.median(heights_m))).astype(int)
                named = zip([frame.camera.name for frame, _ in seen], off_mm, strict=True)
                listed = ", ".join(f"{name} {off:+d} mm" for name, off in named)
                doubts.append(f"the cameras do not agree how high the table is: {listed}: calibrate them again")
        return doubts


def take_in(
    client: RoboPromptClient, frames: Sequence[RgbdFrame], object_models: Mapping[str, Mapping[str, Any]]
) -> Sight:
    """Let the service find each object in the frames.

    Raises:
        ServiceUnreachableError: if it does not answer.
    """
    surfaces = [find_flat_surface(frame) for frame in frames]
    tables = tuple(None if item is None or item.tilt_deg > TABLE_DEG else item for item in surfaces)
    return Sight(tuple(frames), tables, tuple(_find(client, frames, *item) for item in object_models.items()))


def _find(client: RoboPromptClient, frames: Sequence[RgbdFrame], name: str, model: Mapping[str, Any]) -> Found:
    try:
        (pose,) = client.find_poses(frames, {name: model})
    except ServiceProblemError as error:
        return Found(name, None, f"{error.problem.get('detail') or error}{_color_hint(client, frames, name, model)}")
    return Found(name, pose, "")


def _color_hint(client: RoboPromptClient, frames: Sequence[RgbdFrame], name: str, model: Mapping[str, Any]) -> str:
    """Whether an object that is not found is there once red and blue are swapped."""
    swapped = [replace(frame, rgb=frame.rgb[..., ::-1].copy()) for frame in frames if frame.rgb is not None]
    try:
        client.find_poses(swapped, {name: model})
    except ServiceProblemError:
        return ""
    return "; it is found once red and blue are swapped: the camera's driver gives them the other way round"


def camera_rows(sight: Sight) -> list[tuple[str, ...]]:
    """Cells of `CAMERA_COLUMNS`."""
    return [_camera_row(*item) for item in zip(sight.frames, sight.tables, strict=True)]


def _camera_row(frame: RgbdFrame, table: FlatSurface | None) -> tuple[str, ...]:
    size = "none" if frame.rgb is None else "{1}x{0}".format(*frame.rgb.shape)
    known = middle = "no depth"
    if frame.depth_m is not None:
        measured_m = frame.depth_m[frame.depth_m > 0]
        known = f"{measured_m.size / frame.depth_m.size:.0%}"
        middle = f"{np.median(measured_m):.3f} m" if measured_m.size else "none"
    level = "none" if table is None else f"at {round(table.middle_m[2], 3) + 0:.3f} m, tilted by {table.tilt_deg:.1f}°"
    return frame.camera.name, size, known, middle, level


def object_rows(sight: Sight) -> list[tuple[str, ...]]:
    """Cells of `OBJECT_COLUMNS`; of an object that was not found the reason."""
    return [_object_row(item) for item in sight.objects]


def _object_row(found: Found) -> tuple[str, ...]:
    pose = found.pose
    if pose is None:
        return found.name, "NOT FOUND", found.problem
    place = " ".join(f"{value:.3f}" for value in pose.position_m)
    yaw = "unknown" if pose.quaternion_xyzw is None else f"{np.degrees(yaw_rad(pose.quaternion_xyzw)):.0f}°"
    return found.name, place, yaw, f"{pose.confidence:.2f}", ", ".join(pose.cameras)


def in_columns(rows: Iterable[Sequence[str]]) -> str:
    """Rows of cells for a terminal; the last cell of a row may be longer than its column."""
    listed = list(rows)
    widths = [max(len(row[k]) for row in listed if len(row) > k + 1) for k in range(max(map(len, listed)) - 1)]
    lines = ["  ".join([*(c.ljust(w) for c, w in zip(row[:-1], widths, strict=False)), row[-1]]) for row in listed]
    return "\n".join(line.rstrip() for line in lines)
