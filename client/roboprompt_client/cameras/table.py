"""The table as calibrated cameras saw it: one that sees it elsewhere later was bumped."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from roboprompt_client.arrays import Array, positions_array
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.errors import CameraError, InvalidInputError
from roboprompt_client.flat_surface import FlatSurface, find_flat_surface

MAX_OFF_M, MAX_TILT_DEG = 0.008, 1.0  # a calibrated camera's table is within 2 mm and 0.3 degrees
OTHER_M, OTHER_DEG = 0.1, 10.0  # what is farther off is another surface
TABLE_JSON = '{"position": [x, y, z], "normal": [0, 0, 1]}: `roboprompt-robot look --remember` writes it'


@dataclass(frozen=True, eq=False)
class Table:
    """A plane in the world: a place on it (3,) in meters, and its upward normal (3,) of unit length."""

    position_m: Array
    normal: Array

    @classmethod
    def seen_in(cls, frames: Iterable[RgbdFrame]) -> "Table":
        """The mean of what the cameras see.

        Raises:
            InvalidInputError: if none of them sees a level surface.
        """
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
