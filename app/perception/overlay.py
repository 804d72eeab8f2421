"""A camera's image with what was found in it drawn over: masks, outlines, axes and names."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from app.perception.base import ObjectQuery
from app.perception.canvas import Canvas, Color, RgbImage
from app.perception.color import color_mask, to_hsv
from app.perception.cuboid_model import CuboidModel
from app.perception.outlines import outlines
from app.perception.rigid import rigid
from app.pipeline.camera import RgbdFrame
from app.pipeline.episode import ObjectPose
from app.pipeline.errors import InvalidInputError
from app.pipeline.geometry import transform_points

# Okabe and Ito, "Color Universal Design" (2008): the colour-blind distinguish them, too
PALETTE: tuple[Color, ...] = (
    (230, 159, 0),
    (86, 180, 233),
    (0, 158, 115),
    (240, 228, 66),
    (213, 94, 0),
    (204, 121, 167),
    (0, 114, 178),
)
AXIS_COLORS: tuple[Color, ...] = ((230, 30, 30), (30, 180, 30), (40, 80, 255))
AXIS_M = 0.05


def draw_overlay(frame: RgbdFrame, poses: Sequence[ObjectPose], queries: Sequence[ObjectQuery] = ()) -> RgbImage:
    """A copy of the frame's colours, (H, W, 3), with `poses` drawn in.

    A pose without rotation is a dot; an object outside of the view is only named, at the bottom.

    Args:
        queries: what was known of the objects, for their masks and outlines; by name.

    Raises:
        InvalidInputError: if the frame has no colours.
    """
    if frame.rgb is None:
        raise InvalidInputError(f"rgb_{frame.camera.name}", "is missing", "a camera with a colour image")
    canvas = Canvas(frame.camera, frame.rgb.copy())
    known = {query.name: query for query in queries}
    styled = [(pose, known.get(pose.name), PALETTE[i % len(PALETTE)]) for i, pose in enumerate(poses)]
    for _, query, color in styled:
        if query is not None and (mask := _mask(frame, query)) is not None:
            canvas.tint(mask, color)
    for pose, query, color in styled:
        _draw_shape(canvas, pose, query, color)
    for pose, _, color in styled:
        canvas.name(_label(pose), pose.position_m, color)
    return canvas.image


def _mask(frame: RgbdFrame, query: ObjectQuery) -> npt.NDArray[np.bool_] | None:
    """The pixels that count as the object's, where the query tells."""
    if query.mask_ids and frame.mask is not None:
        return np.isin(frame.mask, query.mask_ids)
    if isinstance(query.model, CuboidModel) and frame.rgb is not None:
        return np.asarray(color_mask(to_hsv(frame.rgb), query.model.color), np.bool_)
    return None


def _draw_shape(canvas: Canvas, pose: ObjectPose, query: ObjectQuery | None, color: Color) -> None:
    if pose.quaternion_xyzw is None:
        canvas.dot(pose.position_m, color)
        return
    object_to_world = rigid(pose.position_m, pose.quaternion_xyzw)
    for line in outlines(None if query is None else query.model):
        canvas.line(transform_points(object_to_world, line), color)
    for axis, axis_color in zip(AXIS_M * np.eye(3), AXIS_COLORS, strict=True):
        canvas.line(transform_points(object_to_world, np.array([np.zeros(3), axis])), axis_color, bold=True)


def _label(pose: ObjectPose) -> str:
    return pose.name if pose.confidence == 1 else f"{pose.name} {pose.confidence:.2f}"
