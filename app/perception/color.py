"""Which pixels have an object's colour."""

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.cuboid_model import ColorModel

HsvImage = npt.NDArray[np.uint8]  # (H, W, 3)
HUE_STEPS_PER_DEG = 256 / 360  # OpenCV's HSV_FULL


def to_hsv(rgb: npt.NDArray[np.uint8]) -> HsvImage:
    """(H, W, 3): hue in 256 steps of a turn, saturation and value in 0..255."""
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV_FULL), np.uint8)


def color_mask(hsv: HsvImage, color: ColorModel) -> npt.NDArray[np.uint8]:
    """(H, W), 255 where a pixel has the colour."""
    first, last = (round(hue * HUE_STEPS_PER_DEG) % 256 for hue in color.hue_deg)
    (low_s, high_s), (low_v, high_v) = ((round(255 * x) for x in pair) for pair in (color.saturation, color.value))
    spans = [(first, last)] if first <= last else [(first, 255), (0, last)]
    masks = [cv2.inRange(hsv, (low, low_s, low_v), (high, high_s, high_v)) for low, high in spans]
    return np.asarray(masks[0] if len(masks) == 1 else cv2.bitwise_or(*masks), np.uint8)
