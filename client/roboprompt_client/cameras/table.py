"""The table, which tells whether a camera is where its pose says: the largest flat surface in each picture."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from roboprompt_client.errors import CameraError, InvalidInputError
from roboprompt_client.types.arrays import Array, positions_array
from roboprompt_client.types.camera import RgbdFrame

GRID_ROWS = 30  # of pixels that are looked at
NUM_TRIALS = 60
# Standard deviation of a stereo camera's depth (Intel D400) at 1 m; it grows with the square of the distance
DEPTH_SIGMA_AT_1_M = 0.002
FLAT_M = 3 * DEPTH_SIGMA_AT_1_M  # points nearer to a plane than this, at 1 m, belong to it
MIN_SHARE = 0.25  # of the points, for a plane to count as table or floor
MAX_OFF_M, MAX_TILT_DEG = 0.008, 1.0  # a calibrated camera's table is within 2 mm and 0.3 degrees
OTHER_M, OTHER_DEG = 0.1, 10.0  # what is farther off is another surface
TABLE_JSON = '{"position": [x, y, z], "normal": [0, 0, 1]}: `roboprompt-robot look --remember` writes it'


@dataclass(frozen=True, eq=False)
class FlatSurface:
    """A plane in the world frame.

    Attributes:
        normal: (3,) of unit length, upward.
        middle_m: (3,) the middle of its points that are seen.
        sees_m: (3,) the camera that sees it.
    """

    normal: Array
    middle_m: Array
    sees_m: Array

    @property
    def tilt_deg(self) -> float:
        """Its angle against the horizontal."""
        return math.degrees(math.acos(min(1.0, float(self.normal[2]))))

    @property
    def is_above_the_camera(self) -> bool:
        """Whether the camera would look at its lower side."""
        return bool((self.sees_m - self.middle_m) @ self.normal < 0)

    def height_m(self, place_m: Array) -> float:
        """Its z at a place (>= 2,) in the world."""
        slope = self.normal[:2] / self.normal[2]
        return float(self.middle_m[2] - slope @ (place_m[:2] - self.middle_m[:2]))


def find_flat_surface(frame: RgbdFrame) -> FlatSurface | None:
    """The plane near most points; None where no plane has a quarter of them, or the frame has hardly any depth."""
    if frame.depth_m is None:
        return None
    stride_px = max(1, frame.depth_m.shape[0] // GRID_ROWS)
    depth_m = frame.depth_m[::stride_px, ::stride_px]
    rows, columns = np.nonzero(depth_m > 0)
    if len(rows) < NUM_TRIALS:
        return None
    depths_m = depth_m[rows, columns].astype(np.float64)
    points_m = frame.camera.deproject(rows * stride_px, columns * stride_px, depths_m)
    near = _near_most(points_m, FLAT_M * np.maximum(depths_m, 1.0) ** 2)
    if near.mean() <= MIN_SHARE:
        return None
    middle_m: Array = points_m[near].mean(axis=0)
    normal: Array = np.linalg.svd(points_m[near] - middle_m, full_matrices=False)[2][2]
    return FlatSurface(-normal if normal[2] < 0 else normal, middle_m, frame.camera.camera_to_world[:3, 3])


def _near_most(points_m: Array, tolerance_m: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """(N,) which points are near the plane through three of them that is near most."""
    triples = np.random.default_rng(0).integers(len(points_m), size=(NUM_TRIALS, 3))
    corners = points_m[triples]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    offsets_m = np.abs(normals @ points_m.T - (corners[:, 0] * normals).sum(axis=1, keepdims=True))
    near: np.ndarray[tuple[int, ...], np.dtype[np.bool_]] = offsets_m < tolerance_m
    return near[int(near.sum(axis=1).argmax()), :]


@dataclass(frozen=True, eq=False)
class Table:
    """A plane in the world: a place on it (3,) in meters, and its upward normal (3,) of unit length."""

    position_m: Array
    normal: Array

    @classmethod
    def seen_in(cls, frames: Iterable[RgbdFrame]) -> "Table":
        """The mean of what the cameras see; raises InvalidInputError if none of them sees a level surface."""
        surfaces = [surface for frame in frames if (surface := _level(frame)) is not None]
        if not surfaces:
            raise InvalidInputError("table", "is seen by no camera", "a table that fills a quarter of a picture")
        normal = np.mean([surface.normal for surface in surfaces], axis=0)
        return cls(np.mean([surface.middle_m for surface in surfaces], axis=0), normal / np.linalg.norm(normal))

    @classmethod
    def from_json(cls, document: object) -> "Table":
        """That of a cell's file; raises InvalidInputError if it is none."""
        item: Mapping[str, Any] = document if isinstance(document, Mapping) else {}
        if set(item) != {"position", "normal"}:
            raise InvalidInputError("table", f"is {document!r:.80}", TABLE_JSON)
        position_m = positions_array("table.position", item["position"], (3,))
        normal = positions_array("table.normal", item["normal"], (3,))
        if abs(np.linalg.norm(normal) - 1) > 1e-3 or normal[2] <= 0:
            raise InvalidInputError("table.normal", f"is {normal.tolist()}", "a vector of length 1 that points upward")
        return cls(position_m, normal)

    def to_json(self) -> dict[str, Any]:
        """As it stands in a cell's file."""
        return {"position": self.position_m.round(4).tolist(), "normal": self.normal.round(5).tolist()}

    def check(self, frames: Iterable[RgbdFrame]) -> None:
        """Refuse the pictures of a camera that sees the table elsewhere; raises CameraError naming it."""
        for frame in frames:
            surface = _level(frame)
            if surface is None:
                continue
            off_m = float((surface.middle_m - self.position_m) @ self.normal)
            tilt_deg = math.degrees(math.acos(min(1.0, float(surface.normal @ self.normal))))
            bumped = abs(off_m) > MAX_OFF_M or tilt_deg > MAX_TILT_DEG
            if bumped and abs(off_m) < OTHER_M and tilt_deg < OTHER_DEG:
                what = f"it sees the table {1000 * off_m:+.0f} mm and {tilt_deg:.1f} degrees off: it was bumped"
                remedy = "calibrate it again; `look --remember` if the table is another one"
                raise CameraError(what, remedy, frame.camera.name)


def _level(frame: RgbdFrame) -> FlatSurface | None:
    surface = find_flat_surface(frame)
    return None if surface is None or surface.tilt_deg > OTHER_DEG else surface
