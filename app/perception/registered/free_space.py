"""What labelled views show to be free around an object: their depth images, cut to where it is."""

from collections.abc import Sequence

import numpy as np

from app.perception.registered.view import View
from roboprompt_client.arrays import Array
from roboprompt_client.camera import Camera


def free_views_of(
    views: Sequence[View], template_to_world: Array, points_m: Array, margin_m: float
) -> tuple[View, ...]:
    """The views cut to where the template's points (N, 3) and what is nearer to them than a margin appear."""
    cut = (_cut(view, template_to_world, points_m, margin_m) for view in views)
    return tuple(view for view in cut if view is not None)


def _cut(view: View, template_to_world: Array, points_m: Array, margin_m: float) -> View | None:
    pose = np.linalg.inv(template_to_world) @ view.camera.camera_to_world
    pixels, depth_m = _moved(view.camera, pose, 0, 0).project(points_m)
    if (depth_m <= 0).any():
        return None
    margin_px = margin_m * max(view.camera.fx_px, view.camera.fy_px) / depth_m.min()
    height, width = view.depth_m.shape
    left, top = np.clip(np.floor(pixels.min(axis=0) - margin_px), 0, (width, height)).astype(int)
    right, bottom = np.clip(np.ceil(pixels.max(axis=0) + margin_px) + 1, 0, (width, height)).astype(int)
    if right - left < 2 or bottom - top < 2:
        return None
    nearest_m = view.nearest_m[top:bottom, left:right].copy()
    return View(_moved(view.camera, pose, left, top), nearest_m, nearest_m, np.zeros((0, 0, 3), np.uint8))


def _moved(camera: Camera, camera_to_template: Array, left_px: int, top_px: int) -> Camera:
    """The camera of a part of its image, in the template's frame."""
    pose = camera_to_template.copy()
    pose[3] = 0, 0, 0, 1
    intrinsics = camera.fx_px, camera.fy_px, camera.cx_px - left_px, camera.cy_px - top_px
    return Camera(camera.name, *intrinsics, pose)
