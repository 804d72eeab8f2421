"""A camera's image with found objects drawn in: masks, outlines, axes and names."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from app.drawing import Canvas, Color, RgbImage
from app.perception.base import ObjectQuery
from app.perception.cuboid.model import CuboidModel
from app.perception.cuboid.segmentation import color_mask, to_hsv
from app.perception.cuboid.shape import outline_points_m
from app.perception.markers.model import MarkersModel
from app.perception.object_model import ObjectModel
from app.pipeline.geometry import rigid, transform_points
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import ObjectPose

# Okabe and Ito, "Color Universal Design" (2008): distinguishable by color-blind people
PALETTE: tuple[Color, ...] = (
    (230, 159, 0),
    (86, 180, 233),
    (0, 158, 115),
    (240, 228, 66),
    (213, 94, 0),
    (204, 121, 167),
    (0, 114, 178),
)
NUM_SIDES = 4  # of a cylinder, as of a box
_SQUARE = np.array([[-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0], [-0.5, -0.5, 0], [-0.5, 0.5, 0]])


def outlines(model: ObjectModel | None) -> list[Array]:
    """Return an object's outline as polylines (N, 3) in its frame; none for a model without a shape."""
    if isinstance(model, CuboidModel):
        rims = outline_points_m(model.shape, np.array([0.0, 0, 0, 0, *model.size_m])) - model.origin_m
        low, high = np.split(rims, 2)
        sides = np.stack([low, high], axis=1)[:: len(low) // NUM_SIDES]
        return [np.vstack([low, low[:1]]), np.vstack([high, high[:1]]), *sides]
    if isinstance(model, MarkersModel):
        return [transform_points(np.array(item.marker_to_object), item.size_m * _SQUARE) for item in model.markers]
    return []


def draw_overlay(frame: RgbdFrame, poses: Sequence[ObjectPose], queries: Sequence[ObjectQuery] = ()) -> RgbImage:
    """Return a copy of the frame's image (H, W, 3) with `poses` drawn in.

    A pose without rotation is a dot; an object outside of the view is named at the bottom.

    Args:
        queries: the objects' queries, for masks and outlines.

    Raises:
        InvalidInputError: if the frame has no colors.
    """
    if frame.rgb is None:
        raise InvalidInputError(f"rgb_{frame.camera.name}", "is missing", "a camera with a color image")
    canvas = Canvas(frame.camera, frame.rgb.copy())
    known = {query.name: query for query in queries}
    styled = [(pose, known.get(pose.name), PALETTE[i % len(PALETTE)]) for i, pose in enumerate(poses)]
    for _, query, color in styled:
        if query is not None and (mask := _mask(frame, query)) is not None:
            canvas.tint(mask, color)
    for pose, query, color in styled:
        if pose.quaternion_xyzw is not None:
            object_to_world = rigid(pose.position_m, pose.quaternion_xyzw)
            for line in outlines(None if query is None else query.model):
                canvas.line(transform_points(object_to_world, line), color)
        canvas.pose(pose, color)
    for pose, _, color in styled:
        label = pose.name if pose.confidence == 1 else f"{pose.name} {pose.confidence:.2f}"
        if not canvas.name(label, pose.position_m, color):
            canvas.note(f"{label}: outside of this view", color)
    return canvas.image


def _mask(frame: RgbdFrame, query: ObjectQuery) -> npt.NDArray[np.bool_] | None:
    """Return the object's pixels by its mask ids or its color, or None."""
    if query.mask_ids and frame.mask is not None:
        return np.isin(frame.mask, query.mask_ids)
    if isinstance(query.model, CuboidModel) and frame.rgb is not None:
        return np.asarray(color_mask(to_hsv(frame.rgb), query.model.color), np.bool_)
    return None
