"""One observation of all cameras: what stands on the table, prepared once for all objects of a request."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.frame_checks import check_level, check_rgbd
from app.perception.registered.cloud import normals_of, thinned
from app.perception.registered.table import Table, find_table
from app.perception.registered.view import FARTHEST_M, RgbImage, View
from app.pipeline.geometry import pixels_to_world
from roboprompt_client.arrays import Array
from roboprompt_client.camera import RgbdFrame
from roboprompt_client.errors import InvalidInputError

ABOVE_TABLE_M = (0.006, 0.6)
POINTS_WIDTH_PX = 400  # of the grid of pixels that become points
LIGHTNESS = 0.4  # how much it counts among colors: shading changes it
DARKEST_RGB = 5.0  # a darker table does not show the light
LAB_OFFSET, LAB_SCALE = np.array([0.0, 128, 128]), np.array([LIGHTNESS * 100 / 255, 1, 1])


@dataclass(frozen=True, eq=False)
class Scene:
    """What the cameras see of the table and of what stands on it, in the world frame.

    Attributes:
        points_m, normals: (N, 3) of what lies above the table, one point a voxel.
        rgb: (N, 3) their colors, 0..255.
    """

    views: tuple[View, ...]
    table: Table
    points_m: Array
    rgb: Array
    normals: Array

    @classmethod
    def of(cls, frames: Sequence[RgbdFrame]) -> "Scene":
        """Of frames with color and depth.

        Raises:
            InvalidInputError: if there is no frame, a frame's images are unusable, or no camera sees a level table.
        """
        if not frames:
            raise InvalidInputError("cameras", "there is none", "rgb_NAME and depth_NAME of at least one camera")
        for frame in frames:
            check_rgbd(frame)
            check_level(frame)
        views = tuple(map(View.of, frames))
        points_m, rgb, eyes_m = (np.concatenate(parts) for parts in zip(*map(_points, views), strict=True))
        table = find_table(points_m, rgb)
        if table is None:
            seen = ", ".join(f"depth_{view.camera.name} ({_unknown(view)} unknown)" for view in views)
            remedy = "images in which a level table fills at least a tenth; camera_to_world in a world whose z is up"
            raise InvalidInputError("cameras", f"no level surface is seen in {seen}", remedy)
        height_m = table.height_m(points_m)
        up = (height_m > ABOVE_TABLE_M[0]) & (height_m < ABOVE_TABLE_M[1])
        up[up] = table.holds(points_m[up])
        points_m, rgb, eyes_m = thinned(points_m[up], rgb[up], eyes_m[up])
        return cls(views, table, points_m, rgb, normals_of(points_m, eyes_m))

    def in_light_of(self, table_rgb: Array) -> "LitScene":
        """The scene with its colors as they would be if its table looked like (3,) 0..255."""
        gain = table_rgb / np.maximum(self.table.rgb, DARKEST_RGB)
        images = tuple(_lab_image(view.rgb, gain) for view in self.views)
        return LitScene(self, images, to_lab(self.rgb, gain))


@dataclass(frozen=True, eq=False)
class LitScene:
    """A scene and its colors in the light of a template.

    Attributes:
        images: per view (H, W, 3) uint8 in OpenCV's Lab; see `lab_at`.
        lab: (N, 3) of the points.
    """

    scene: Scene
    images: tuple[npt.NDArray[np.uint8], ...]
    lab: Array

    def lab_at(self, number: int, rows: npt.NDArray[np.intp], columns: npt.NDArray[np.intp]) -> Array:
        """(..., 3) colors of pixels of view `number`."""
        return scaled_lab(self.images[number][rows, columns])


def to_lab(rgb: Array, gain: Array | float = 1.0) -> Array:
    """(N, 3) colors for comparison from (N, 3) 0..255 times a gain (3,): Lab, lightness counted less."""
    pixels = np.clip(rgb * gain + 0.5, 0, 255).astype(np.uint8)
    return scaled_lab(cv2.cvtColor(pixels[None], cv2.COLOR_RGB2LAB)[0]) if len(pixels) else np.zeros((0, 3))


def scaled_lab(lab_uint8: npt.NDArray[np.uint8]) -> Array:
    """(..., 3) from OpenCV's 8-bit Lab."""
    scaled: Array = (lab_uint8 - LAB_OFFSET) * LAB_SCALE
    return scaled


def _lab_image(rgb: RgbImage, gain: Array) -> npt.NDArray[np.uint8]:
    brighter = np.clip(np.arange(256)[:, None] * gain + 0.5, 0, 255).astype(np.uint8)
    return np.asarray(cv2.cvtColor(cv2.LUT(rgb, brighter[None]), cv2.COLOR_RGB2LAB), np.uint8)


def _unknown(view: View) -> str:
    return f"{np.mean(view.depth_m == 0):.0%}"


def _points(view: View) -> tuple[Array, Array, Array]:
    """(N, 3) points, colors and where the camera stands, on a grid of pixels."""
    step = max(1, round(view.depth_m.shape[1] / POINTS_WIDTH_PX))
    depth_m = view.depth_m[::step, ::step]
    rows, columns = np.nonzero((depth_m > 0) & (depth_m < FARTHEST_M))
    rows, columns = step * rows, step * columns
    points_m = pixels_to_world(view.camera, rows, columns, view.depth_m[rows, columns])
    return points_m, view.rgb[rows, columns].astype(np.float64), np.broadcast_to(view.eye_m, points_m.shape)
