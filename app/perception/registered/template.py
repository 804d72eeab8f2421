"""The appearance of an object: a colored point cloud with normals, and depth images that show free space around it.

The template's frame: z up, the origin in the middle of its points, or on the axis of a round object. The file format is
.npz without pickles.
"""

import io
from dataclasses import dataclass
from functools import cached_property
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.spatial import ConvexHull, cKDTree

from app.perception.registered.depth_view import VOXEL_M, DepthView, Index, lengths
from app.perception.registered.scene import to_lab
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera

MAX_SPAN_M = 0.7  # of an object
MARGIN_M = 0.03  # margin of the voxel grid of nearest points
DEPTH_UNIT_M = 1e-4  # of depths in the file: up to 6.5 m
COLOR_CELL = 12.0  # Lab units: finer differences are one color of the object
RARE_SHARE = 0.01  # a color of a smaller share of the points is noise
SAME_LIGHT_LAB = 12.0  # tolerance of its colors in the light that it was taught in, in Lab units
MAX_RISE_M = 0.025  # tolerance of the taught height above the table: a cloth, errors of calibration
STANDS_WITHIN_M = 0.03  # an object stands on the table if its lowest point is less above it
LAB_AS_M = 0.0006  # meters per Lab unit in distances of place and color together


@dataclass(frozen=True, eq=False)
class Template:
    """The object, from one or more labeled views.

    Attributes:
        points_m, normals, rgb: (N, 3) in the template's frame; colors 0..255.
        free_views: depth images whose "world" is the template's frame.
        table_rgb: (3,) color of the table in the views.
        bottom_m: z of the table below it.
        scores: of the further views when they were merged; a right pose has a similar score.
        yaw_symmetry_deg: the rotation symmetry about z: 0 round, None none.
    """

    points_m: Array
    normals: Array
    rgb: Array
    free_views: tuple[DepthView, ...]
    table_rgb: Array
    bottom_m: float
    scores: tuple[float, ...] = ()
    yaw_symmetry_deg: float | None = None

    def __len__(self) -> int:
        return len(self.points_m)

    @property
    def above_table_m(self) -> float:
        """Height of its lowest point; above `STANDS_WITHIN_M` for a part of an object, or one that lies on another."""
        return float(np.percentile(self.points_m[:, 2], 2)) - self.bottom_m

    @cached_property
    def lab(self) -> Array:
        """Comparable colors (N, 3), see `to_lab`."""
        return to_lab(self.rgb)

    @cached_property
    def width_m(self) -> float:
        """Its approximate largest horizontal extent."""
        return 2 * float(np.linalg.norm(self.points_m[:, :2] - self.points_m[:, :2].mean(axis=0), axis=1).max())

    @cached_property
    def narrowest_m(self) -> float:
        """Its approximate smallest horizontal extent."""
        headings = np.radians(np.arange(0, 180, 15))
        return float(np.ptp(self.points_m[:, :2] @ np.array([np.cos(headings), np.sin(headings)]), axis=0).min())

    @cached_property
    def reach_m(self) -> float:
        """The largest distance of a point from the mean of all."""
        return float(lengths(self.points_m - self.points_m.mean(axis=0)).max())

    @cached_property
    def hull(self) -> Array:
        """The faces (F, 4) of its convex hull: outward normals and offsets."""
        faces: Array = ConvexHull(self.points_m, qhull_options="QJ").equations
        return faces

    @cached_property
    def palette(self) -> cKDTree:
        """A tree of its distinct colors in Lab."""
        cells, inverse, counts = np.unique(
            np.floor(self.lab / COLOR_CELL), axis=0, return_inverse=True, return_counts=True
        )
        sums = np.stack([np.bincount(inverse, self.lab[:, axis], len(cells)) for axis in range(3)], axis=1)
        frequent = counts >= min(RARE_SHARE * len(self), counts.max())
        return cKDTree((sums / counts[:, None])[frequent])

    @cached_property
    def tree(self) -> cKDTree:
        """A tree of places and colors together, (N, 6)."""
        return cKDTree(np.concatenate([self.points_m, self.lab * LAB_AS_M], axis=1))

    @cached_property
    def _low_m(self) -> Array:
        """The lowest corner (3,) of the voxel grid of nearest points."""
        low_m: Array = self.points_m.min(axis=0) - MARGIN_M
        return low_m

    @cached_property
    def _nearest(self) -> npt.NDArray[np.int32]:
        """The index of the nearest point for each voxel."""
        shape = np.ceil((self.points_m.max(axis=0) + MARGIN_M - self._low_m) / VOXEL_M).astype(int) + 1
        cells = tuple(((self.points_m - self._low_m) / VOXEL_M).astype(int).T)
        is_empty, index = np.ones(shape, bool), np.zeros(shape, np.int32)
        is_empty[cells], index[cells] = False, np.arange(len(self))
        where = ndimage.distance_transform_edt(is_empty, return_distances=False, return_indices=True)
        nearest: npt.NDArray[np.int32] = index[tuple(where)]
        return nearest

    def closest(self, points_m: Array) -> Index:
        """Return the index (...) of the approximately nearest point to each of (..., 3)."""
        cells = ((points_m - self._low_m) / VOXEL_M).astype(int)
        cells = np.clip(cells, 0, np.array(self._nearest.shape) - 1)
        index: Index = self._nearest[cells[..., 0], cells[..., 1], cells[..., 2]].astype(np.intp)
        return index

    def distance_m(self, points_m: Array) -> Array:
        """Return the distance (...) of each of (..., 3) from the approximately nearest point."""
        return lengths(points_m - self.points_m[self.closest(points_m)])

    def to_bytes(self) -> bytes:
        """Return the template as a file; `from_bytes` is the inverse to 0.1 mm."""
        arrays: dict[str, npt.NDArray[np.generic]] = {
            "points_m": self.points_m.astype(np.float32),
            "normals": self.normals.astype(np.float32),
            "rgb": np.rint(self.rgb).astype(np.uint8),
            "table_rgb": self.table_rgb,
            "bottom_m": np.array(self.bottom_m),
            "scores": np.array(self.scores),
            "yaw_symmetry_deg": np.array(np.nan if self.yaw_symmetry_deg is None else self.yaw_symmetry_deg),
        }
        for number, view in enumerate(self.free_views):
            camera = view.camera
            arrays[f"pose_{number}"] = camera.camera_to_world
            arrays[f"intrinsics_{number}"] = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
            units = np.rint(view.nearest_m / DEPTH_UNIT_M)
            arrays[f"nearest_{number}"] = np.where(units < 2**16, units, 0).astype(np.uint16)
        file = io.BytesIO()
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
        return file.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> "Template":
        """Return the template of a file.

        Raises:
            InvalidInputError: if the file is not a template.
        """
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as file:
                return cls._from_arrays({name: file[name] for name in file.files})
        except (EOFError, KeyError, ValueError, OSError, BadZipFile) as error:
            raise InvalidInputError("template", f"is no template ({error})", "one that was learned here") from None

    @classmethod
    def _from_arrays(cls, arrays: dict[str, Array]) -> "Template":
        views = []
        for number in range(sum(name.startswith("pose_") for name in arrays)):
            fx_px, fy_px, cx_px, cy_px = arrays[f"intrinsics_{number}"].tolist()
            camera = Camera(f"view_{number}", fx_px, fy_px, cx_px, cy_px, arrays[f"pose_{number}"])
            views.append(DepthView.of_depth(camera, (arrays[f"nearest_{number}"] * DEPTH_UNIT_M).astype(np.float32)))
        symmetry_deg = float(arrays["yaw_symmetry_deg"])
        points_m, normals, rgb = (arrays[name].astype(np.float64) for name in ("points_m", "normals", "rgb"))
        return cls(
            points_m,
            normals,
            rgb,
            tuple(views),
            arrays["table_rgb"],
            float(arrays["bottom_m"]),
            tuple(arrays["scores"].tolist()),
            None if np.isnan(symmetry_deg) else symmetry_deg,
        )
