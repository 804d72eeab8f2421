"""Exact pictures and depth of flat textured quads, smooth at their edges, without OpenGL."""

from dataclasses import dataclass

import cv2
import numpy as np

from roboprompt_client.types.camera import Camera, RgbdFrame

WIDTH_PX, HEIGHT_PX, FOCAL_PX = 640, 480, 620.0
SUPERSAMPLING = 4
TABLE_GREY, QUAD_TEXELS = 120, 16  # texels a cell or a plain quad's side


@dataclass(frozen=True, eq=False)
class Quad:
    """A rectangle in the x-y plane of its own frame, seen from +z.

    Attributes:
        quad_to_world: (4, 4); x to the texture's right, y to its top.
        texture: (h, w) uint8, its first row at +y.
    """

    quad_to_world: np.ndarray
    size_m: tuple[float, float]
    texture: np.ndarray


def looking_at(eye_m, target_m):
    """(4, 4) camera_to_world, the image's horizon level."""
    forward = np.subtract(target_m, eye_m)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = eye_m
    return pose


def camera(name="front", eye_m=(0.6, 0.5, 0.7), target_m=(0.0, 0.0, 0.0)):
    center = (WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2
    return Camera(name, FOCAL_PX, FOCAL_PX, *center, looking_at(eye_m, target_m))


def marker_quad(dictionary, marker_id, size_m, marker_to_world):
    """A marker with a white rim of one cell."""
    image = cv2.aruco.generateImageMarker(dictionary, marker_id, (dictionary.markerSize + 2) * QUAD_TEXELS)
    rim = QUAD_TEXELS
    image = cv2.copyMakeBorder(image, rim, rim, rim, rim, cv2.BORDER_CONSTANT, value=255)
    side_m = size_m * len(image) / (len(image) - 2 * rim)
    return Quad(marker_to_world, (side_m, side_m), image)


def render(view, quads, table_z_m=0.0):
    """Colors and exact depth of a table and `quads`, the farther ones painted first."""
    table_to_world = np.eye(4)
    table_to_world[2, 3] = table_z_m
    table = Quad(table_to_world, (8.0, 8.0), np.full((QUAD_TEXELS, QUAD_TEXELS), TABLE_GREY, np.uint8))
    s = SUPERSAMPLING
    grey = np.full((HEIGHT_PX * s, WIDTH_PX * s), TABLE_GREY, np.uint8)
    depth_m = _plane_depth(view, table)
    eye = view.camera_to_world[:3, 3]
    for quad in sorted(quads, key=lambda q: -np.linalg.norm(q.quad_to_world[:3, 3] - eye)):
        if quad.quad_to_world[:3, 2] @ (eye - quad.quad_to_world[:3, 3]) <= 0:
            continue
        mapping = _texels_to_fine_pixels(view, quad)
        size = grey.shape[::-1]
        painted = cv2.warpPerspective(quad.texture, mapping, size, flags=cv2.INTER_NEAREST)
        covered = cv2.warpPerspective(np.full_like(quad.texture, 255), mapping, size, flags=cv2.INTER_NEAREST) > 0
        grey = np.where(covered, painted, grey)
        share = cv2.resize(covered.astype(np.float32), (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA)
        depth_m = np.where(share > 0.5, _plane_depth(view, quad), depth_m)
    small = cv2.resize(grey, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA)
    return RgbdFrame(view, np.repeat(small[..., None], 3, axis=2), depth_m.astype(np.float32))


def _texels_to_fine_pixels(view, quad):
    """(3, 3): texel index -> index of a pixel that is SUPERSAMPLING times finer; both count centers."""
    rows, columns = quad.texture.shape
    width, height = quad.size_m
    texel_to_quad = np.array(
        [
            [width / columns, 0, width * (0.5 / columns - 0.5)],
            [0, -height / rows, height * (0.5 - 0.5 / rows)],
            [0, 0, 0],
            [0, 0, 1],
        ]
    )
    s = SUPERSAMPLING
    fine = np.array([[s, 0, (s - 1) / 2], [0, s, (s - 1) / 2], [0, 0, 1]])
    to_camera = np.linalg.inv(view.camera_to_world) @ quad.quad_to_world
    return fine @ _intrinsics(view) @ to_camera[:3] @ texel_to_quad


def _plane_depth(view, quad):
    """(H, W) depth along the optical axis at which each pixel's ray meets the quad's plane."""
    columns, rows = np.meshgrid(np.arange(WIDTH_PX), np.arange(HEIGHT_PX))
    x, y = (columns - view.cx_px) / view.fx_px, (rows - view.cy_px) / view.fy_px
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ view.camera_to_world[:3, :3].T
    normal = quad.quad_to_world[:3, 2]
    return (quad.quad_to_world[:3, 3] - view.camera_to_world[:3, 3]) @ normal / (rays @ normal)


def _intrinsics(view):
    return np.array([[view.fx_px, 0, view.cx_px], [0, view.fy_px, view.cy_px], [0, 0, 1]])
