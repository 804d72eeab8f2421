"""Object poses and actions drawn into a camera's image, with labels.

Labels are legible on any background, beside what they name, and never one on another.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial.transform import Rotation

from app.pipeline.geometry import transform_points
from app.sim.rendering import RgbImage
from roboprompt_client.arrays import Array
from roboprompt_client.camera import Camera
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

FONT_PX = 17
OUTLINE_PX = 2
GAP_PX = 9  # between a point and its label
MARGIN_PX = 3
MAX_SHIFTS = 20

Colour = tuple[int, int, int]
Box = tuple[float, float, float, float]  # left, top, right, bottom, in px
AXIS_LENGTH_M = 0.07
AXIS_COLOURS: tuple[Colour, ...] = ((235, 50, 45), (40, 175, 70), (50, 110, 255))  # x, y, z
ORIGIN_COLOUR: Colour = (228, 130, 83)  # the paper's colours of object poses and actions
ACTION_COLOUR: Colour = (0, 113, 188)
WHITE: Colour = (255, 255, 255)
RADIUS_PX = 5
LINE_PX = 2
TIP_SHARE = 0.22
SUBPIXEL_BITS = 4  # of OpenCV's fixed-point coordinates
SAME_PLACE_PX = 8.0


@dataclass(frozen=True)
class Label:
    """A text that belongs to a pixel (x, y).

    Attributes:
        on_left: whether its first choice is the point's left rather than its right.
    """

    text: str
    point_px: tuple[float, float]
    colour: Colour = (255, 255, 255)
    on_left: bool = False


def draw_labels(image: RgbImage, labels: Sequence[Label]) -> RgbImage:
    """A copy of `image` with the labels, each beside its point where there is room, and wholly in the image."""
    canvas = Image.fromarray(image)
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(FONT_PX)
    taken = [_around(label.point_px) for label in labels]
    for label in labels:
        _, _, width, height = draw.textbbox((0, 0), label.text, font, stroke_width=OUTLINE_PX)
        box = _free_box(label, width, height, canvas.size, taken)
        taken.append(box)
        outline = (0, 0, 0) if sum(label.colour) > 3 * 127 else (255, 255, 255)
        draw.text(box[:2], label.text, label.colour, font, stroke_width=OUTLINE_PX, stroke_fill=outline)
    return np.asarray(canvas)


def _around(point_px: tuple[float, float]) -> Box:
    x, y = point_px
    reach = GAP_PX - 2
    return x - reach, y - reach, x + reach, y + reach


def _free_box(label: Label, width: float, height: float, size: tuple[int, int], taken: Sequence[Box]) -> Box:
    """The first of the label's possible places that is free; the last of them if none is."""
    for left, top in _corners(label, width, height):
        x = float(np.clip(left, MARGIN_PX, max(size[0] - width - MARGIN_PX, MARGIN_PX)))
        y = float(np.clip(top, MARGIN_PX, max(size[1] - height - MARGIN_PX, MARGIN_PX)))
        box = (x, y, x + width, y + height)
        if not any(_overlap(box, other) for other in taken):
            break
    return box


def _corners(label: Label, width: float, height: float) -> Iterator[tuple[float, float]]:
    """Top left corners: beside the point, then above and below it, further and further away."""
    x, y = label.point_px
    right, left = (x + GAP_PX, y - height / 2), (x - GAP_PX - width, y - height / 2)
    yield from (left, right) if label.on_left else (right, left)
    for shift in range(MAX_SHIFTS):
        away = GAP_PX + shift * height / 2
        yield x - width / 2, y - away - height
        yield x - width / 2, y + away


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def project(camera: Camera, points_m: Array) -> Array:
    """World points (N, 3) -> pixels (N, 2), u = column and v = row; NaN for points behind the camera."""
    world_to_camera = np.linalg.inv(camera.camera_to_world).astype(np.float64)
    x, y, z = transform_points(world_to_camera, points_m).T
    depth_m = np.where(z > 0, z, np.nan)
    u = camera.fx_px * x / depth_m + camera.cx_px
    v = camera.fy_px * y / depth_m + camera.cy_px
    return np.stack([u, v], axis=1)


def draw_scene(
    image: RgbImage, camera: Camera, poses: Sequence[ObjectPose], actions: Sequence[EndEffectorAction] = ()
) -> RgbImage:
    """A copy of `image` (H, W, 3) with objects as axes and names, and actions as a numbered path.

    Axes are red (x), green (y) and blue (z), 7 cm long; an object without rotation is a dot. An action's dot is hollow
    where the gripper is open. What is behind the camera is left out.
    """
    canvas = image.copy()
    numbers = _draw_path(canvas, camera, actions)
    names = [label for pose in poses for label in _draw_pose(canvas, camera, pose)]
    return draw_labels(canvas, [*numbers, *names])


def _draw_pose(canvas: RgbImage, camera: Camera, pose: ObjectPose) -> list[Label]:
    """Draw the axes; the label that names them."""
    origin = project(camera, pose.position_m[None])[0]
    if np.isnan(origin).any():
        return []
    if pose.quaternion_xyzw is not None:
        axes = Rotation.from_quat(pose.quaternion_xyzw).as_matrix().T
        for tip, colour in zip(project(camera, pose.position_m + AXIS_LENGTH_M * axes), AXIS_COLOURS, strict=True):
            _arrow(canvas, origin, tip, colour)
    _dot(canvas, origin, ORIGIN_COLOUR, RADIUS_PX - 1)
    return [Label(pose.name, (origin[0], origin[1]))]


def _draw_path(canvas: RgbImage, camera: Camera, actions: Sequence[EndEffectorAction]) -> list[Label]:
    """Draw the actions; the labels that number them."""
    pixels = project(camera, np.array([action.position_m for action in actions]).reshape(-1, 3))
    for start, end in pairwise(pixels):
        _line(canvas, start, end)
    for pixel, action in zip(pixels, actions, strict=True):
        if not np.isnan(pixel).any():
            _dot(canvas, pixel, WHITE if action.gripper_open else ACTION_COLOUR, RADIUS_PX, ACTION_COLOUR)
    return [Label(text, (x, y), ACTION_COLOUR, on_left=True) for text, (x, y) in _numbered(pixels)]


def _numbered(pixels: Array) -> list[tuple[str, Array]]:
    """The numbers of the actions at each place in the image, e.g. ``("1, 3", pixel)``."""
    places: list[tuple[str, Array]] = []
    for number, pixel in enumerate(pixels, start=1):
        if np.isnan(pixel).any():
            continue
        same = [k for k, (_, other) in enumerate(places) if np.linalg.norm(pixel - other) < SAME_PLACE_PX]
        if same:
            text, place = places[same[0]]
            places[same[0]] = (f"{text}, {number}", place)
        else:
            places.append((str(number), pixel))
    return places


def _line(canvas: RgbImage, start: Array, end: Array) -> None:
    if not np.isnan([start, end]).any():
        cv2.line(canvas, _fixed(start), _fixed(end), ACTION_COLOUR, LINE_PX, cv2.LINE_AA, SUBPIXEL_BITS)


def _arrow(canvas: RgbImage, start: Array, end: Array, colour: Colour) -> None:
    if not np.isnan(end).any():
        cv2.arrowedLine(canvas, _fixed(start), _fixed(end), WHITE, LINE_PX + 2, cv2.LINE_AA, SUBPIXEL_BITS, TIP_SHARE)
        cv2.arrowedLine(canvas, _fixed(start), _fixed(end), colour, LINE_PX, cv2.LINE_AA, SUBPIXEL_BITS, TIP_SHARE)


def _dot(canvas: RgbImage, centre: Array, fill: Colour, radius_px: int, rim: Colour = WHITE) -> None:
    radius = radius_px << SUBPIXEL_BITS
    cv2.circle(canvas, _fixed(centre), radius, fill, cv2.FILLED, cv2.LINE_AA, SUBPIXEL_BITS)
    cv2.circle(canvas, _fixed(centre), radius, rim, LINE_PX, cv2.LINE_AA, SUBPIXEL_BITS)


def _fixed(pixel: Array) -> tuple[int, int]:
    """A pixel as OpenCV's fixed-point integers."""
    x, y = np.rint(pixel * (1 << SUBPIXEL_BITS)).astype(int)
    return int(x), int(y)
