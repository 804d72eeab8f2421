"""Text on pictures: legible on any background, beside what it names, and never one label on another."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from app.sim.rendering import RgbImage

FONT_PX = 17
OUTLINE_PX = 2
GAP_PX = 9  # between a point and its label
MARGIN_PX = 3
MAX_SHIFTS = 20

Colour = tuple[int, int, int]
Box = tuple[float, float, float, float]  # left, top, right, bottom, in px


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
