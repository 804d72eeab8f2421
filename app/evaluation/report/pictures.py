"""Pictures of a report: a camera's image with poses and actions drawn in, and a rollout's images side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from app.drawing import Canvas, Color, RgbImage
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

TILE_WIDTH_PX = 320
CAPTION_HEIGHT_PX = 26
CAPTION_FONT_PX = 15
GAP_PX = 4
MAX_COLUMNS = 4
BACKGROUND = (24, 28, 34)
CAPTION_COLOR = (240, 242, 245)
JPEG_QUALITY = 85
IMAGES = "images"
OBJECT_COLOR: Color = (228, 130, 83)  # the paper's colors of object poses and actions
ACTION_COLOR: Color = (0, 113, 188)
WHITE: Color = (255, 255, 255)
SAME_PLACE_PX = 8.0


def draw_scene(
    image: RgbImage, camera: Camera, poses: Sequence[ObjectPose], actions: Sequence[EndEffectorAction] = ()
) -> RgbImage:
    """Return a copy of `image` (H, W, 3) with objects as axes and names, and actions as a numbered path.

    An action's dot is hollow if its gripper is open. Whatever is outside of the image is left out.
    """
    canvas = Canvas(camera, image.copy())
    way_m = np.array([action.position_m for action in actions]).reshape(-1, 3)
    canvas.line(way_m, ACTION_COLOR)
    for action in actions:
        canvas.dot(action.position_m, WHITE if action.gripper_open else ACTION_COLOR, ACTION_COLOR)
    for pose in poses:
        canvas.pose(pose, OBJECT_COLOR)
    for numbers, point_m in _numbered(camera, way_m):
        canvas.name(numbers, point_m, ACTION_COLOR)
    for pose in poses:
        canvas.name(pose.name, pose.position_m, OBJECT_COLOR)
    return canvas.image


def _numbered(camera: Camera, way_m: Array) -> list[tuple[str, Array]]:
    """Return the numbers of the actions at each place of the image, e.g. ``("1, 3", point_m)``."""
    places: list[tuple[list[int], Array, Array]] = []
    for number, (point_m, pixel) in enumerate(zip(way_m, camera.project(way_m)[0], strict=True), start=1):
        for numbers, _, place in places:
            if np.linalg.norm(pixel - place) < SAME_PLACE_PX:
                numbers.append(number)
                break
        else:
            places.append(([number], point_m, pixel))
    return [(", ".join(map(str, numbers)), point_m) for numbers, point_m, _ in places]


def captions(num_images: int, num_actions: int | None) -> list[str]:
    """Return captions for the images of a rollout of `num_actions` (None: unknown)."""
    of_all = "" if num_actions is None else f" of {num_actions}"
    return ["before"] + [f"after action {k}{of_all}" for k in range(1, num_images)]


def film_tiles(images: Sequence[RgbImage], texts: Sequence[str]) -> list[RgbImage]:
    """Return each image (H, W, 3) scaled to a width of 320 pixels, with its caption below."""
    return [_captioned(image, text) for image, text in zip(images, texts, strict=True)]


def film_grid(tiles: Sequence[RgbImage]) -> RgbImage:
    """Return tiles of one size as one image, at most four in a row."""
    columns = min(len(tiles), MAX_COLUMNS)
    rows = -(-len(tiles) // columns)
    height, width = tiles[0].shape[0] + GAP_PX, tiles[0].shape[1] + GAP_PX
    grid = np.empty((rows * height + GAP_PX, columns * width + GAP_PX, 3), np.uint8)
    grid[:] = BACKGROUND
    for k, tile in enumerate(tiles):
        top, left = k // columns * height + GAP_PX, k % columns * width + GAP_PX
        grid[top : top + tile.shape[0], left : left + tile.shape[1]] = tile
    return grid


def _captioned(image: RgbImage, text: str) -> RgbImage:
    height, width = image.shape[:2]
    tile_height = round(height * TILE_WIDTH_PX / width)
    canvas = Image.new("RGB", (TILE_WIDTH_PX, tile_height + CAPTION_HEIGHT_PX), BACKGROUND)
    canvas.paste(Image.fromarray(cv2.resize(image, (TILE_WIDTH_PX, tile_height), interpolation=cv2.INTER_AREA)))
    middle = (TILE_WIDTH_PX / 2, tile_height + CAPTION_HEIGHT_PX / 2)
    font = ImageFont.load_default(CAPTION_FONT_PX)
    ImageDraw.Draw(canvas).text(middle, text, CAPTION_COLOR, font, anchor="mm")
    return np.asarray(canvas)


@dataclass(frozen=True)
class PagePicture:
    """An image file: its path relative to the page, its description for people who do not see it, and its size."""

    src: str
    alt: str
    width_px: int
    height_px: int


def save_photo(report: Path, name: str, image: RgbImage, alt: str) -> PagePicture:
    """Write the image (H, W, 3) as a JPEG `name` into the folder `images` beside the page."""
    path = report / IMAGES / f"{name}.jpg"
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(image).save(path, quality=JPEG_QUALITY, optimize=True)
    return PagePicture(f"{IMAGES}/{path.name}", alt, image.shape[1], image.shape[0])
