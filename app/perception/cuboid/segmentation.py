"""Color segmentation: the pixels of an object's color, and the connected pieces that they form."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.cuboid.model import ColorModel, Shape
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, RgbdFrame

HsvImage = npt.NDArray[np.uint8]  # (H, W, 3)
HUE_STEPS_PER_DEG = 256 / 360  # OpenCV's HSV_FULL
Bytes = npt.NDArray[np.uint8]
Bools = npt.NDArray[np.bool_]
P = TypeVar("P", bound=np.generic)
MIN_PIXELS = 20
CROSS: Bytes = np.asarray(cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)), np.uint8)
SQUARE: Bytes = np.ones((3, 3), np.uint8)
MIN_SHARE = 0.06  # smaller pieces, relative to the expected pixels of the whole object, are ignored
STEP_PIXELS = 8.0  # a larger step in depth within 3x3 pixels, in pixel widths, separates two objects
MAX_PIECES = 12
SLACK_M, SLACK_FACTOR = 0.012, 1.1  # tolerance for depth noise when pieces are joined


def to_hsv(rgb: npt.NDArray[np.uint8]) -> HsvImage:
    """(H, W, 3): hue in 256 steps of a turn, saturation and value in 0..255."""
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV_FULL), np.uint8)


def color_mask(hsv: HsvImage, color: ColorModel) -> npt.NDArray[np.uint8]:
    """(H, W), 255 where a pixel has the color."""
    first, last = (round(hue * HUE_STEPS_PER_DEG) % 256 for hue in color.hue_deg)
    (low_s, high_s), (low_v, high_v) = ((round(255 * x) for x in pair) for pair in (color.saturation, color.value))
    spans = [(first, last)] if first <= last else [(first, 255), (0, last)]
    masks = [cv2.inRange(hsv, (low, low_s, low_v), (high, high_s, high_v)) for low, high in spans]
    return np.asarray(masks[0] if len(masks) == 1 else cv2.bitwise_or(*masks), np.uint8)


@dataclass(frozen=True, eq=False)
class Piece:
    """Pixels of one object.

    Attributes:
        left_px, top_px: where `mask` lies in the image.
        mask: (h, w) bool.
        distance_m: median depth; 0 where none is known.
    """

    left_px: int
    top_px: int
    mask: Bools
    distance_m: float

    @property
    def num_pixels(self) -> int:
        """How many pixels it has."""
        return int(np.count_nonzero(self.mask))

    def mask_in(self, left_px: int, top_px: int, shape: tuple[int, ...]) -> Bools:
        """Its pixels in a window (h, w) of the image."""
        return window(self.mask, left_px - self.left_px, top_px - self.top_px, shape)


def find_pieces(frame: RgbdFrame, color_mask: Bytes, size_m: Array, shape: Shape) -> list[Piece]:
    """Return the pieces of the mask that may be the object, the largest first.

    Pieces that an occluder separates are joined if together they fit into one object of that size.
    """
    pieces = [
        piece
        for piece in _together(frame, find_parts(frame, color_mask), size_m)
        if piece.num_pixels > MIN_SHARE * _expected_pixels(frame.camera, size_m, piece.distance_m, shape)
    ]
    return sorted(pieces, key=lambda piece: -piece.num_pixels)[:MAX_PIECES]


def _expected_pixels(camera: Camera, size_m: Array, distance_m: float, shape: Shape) -> float:
    """Roughly how many pixels the whole object has, seen from the camera's angle."""
    down = abs(float(camera.camera_to_world[2, 2]))
    level = np.sqrt(max(1 - down**2, 0))
    top_m2 = size_m[0] * size_m[1] * (np.pi / 4 if shape == "cylinder" else 1)
    side_m2 = size_m[2] * (size_m[0] if shape == "cylinder" else (size_m[0] + size_m[1]) * 2 / np.pi)
    return float(camera.fx_px * camera.fy_px / distance_m**2 * (down * top_m2 + level * side_m2))


def find_parts(frame: RgbdFrame, color_mask: Bytes) -> list[Piece]:
    """Return the mask's connected components, the largest first, split where the depth has a step."""
    assert frame.depth_m is not None
    # labeling the whole image would take longer than everything else
    left_px, top_px, width, height = cv2.boundingRect(color_mask)
    cropped = color_mask[top_px : top_px + height, left_px : left_px + width]
    if not cropped.size:
        return []
    faces = cv2.morphologyEx(cropped, cv2.MORPH_OPEN, CROSS)  # removes single pixels and thin strips
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(faces, connectivity=4)
    largest = 1 + np.argsort(-boxes[1:, cv2.CC_STAT_AREA])[: 2 * MAX_PIECES]
    pieces: list[Piece] = []
    for label in largest:
        x, y, width, height, area = (int(item) for item in boxes[label])
        if area < MIN_PIXELS:
            break
        left, top = left_px + x, top_px + y
        mask = labels[y : y + height, x : x + width] == label
        pieces += _parted(frame.camera, left, top, mask, frame.depth_m[top : top + height, left : left + width])
    return sorted((piece for piece in pieces if piece.distance_m > 0), key=lambda piece: -piece.num_pixels)


def _parted(camera: Camera, left: int, top: int, mask: Bools, depth_m: npt.NDArray[np.float32]) -> list[Piece]:
    """Return the mask, split along steps in depth."""
    known = mask & (depth_m > 0)
    if np.count_nonzero(known) < MIN_PIXELS // 2:
        return []
    distance_m = float(quantiles(depth_m[known], 0.5)[0])
    farthest = cv2.dilate(np.where(known, depth_m, np.float32(0)), SQUARE)
    nearest = cv2.erode(np.where(known, depth_m, np.float32(np.inf)), SQUARE)
    smooth = known & (farthest - nearest < STEP_PIXELS * distance_m / camera.fx_px)
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(smooth.astype(np.uint8), connectivity=4)
    parts = [k for k in range(1, count) if boxes[k, cv2.CC_STAT_AREA] >= MIN_PIXELS]
    if len(parts) < 2:
        return [Piece(left, top, mask, distance_m)]
    seeds = np.isin(labels, parts)
    _, nearest_seed = cv2.distanceTransformWithLabels((~seeds).astype(np.uint8), cv2.DIST_L2, 3)
    seed_labels = np.zeros(int(nearest_seed.max()) + 1, np.int32)
    seed_labels[nearest_seed[seeds]] = labels[seeds]
    grown = seed_labels[nearest_seed]
    return [trimmed(left, top, mask & (grown == part), depth_m) for part in parts]


def trimmed(left: int, top: int, mask: Bools, depth_m: npt.NDArray[np.float32]) -> Piece:
    """Return the pixels of a mask, whose corner is at (left, top), as a piece cropped to them."""
    x, y, width, height = cv2.boundingRect(mask.astype(np.uint8))
    cut = np.s_[y : y + height, x : x + width]
    known = mask[cut] & (depth_m[cut] > 0)
    return Piece(left + x, top + y, mask[cut], float(quantiles(depth_m[cut][known], 0.5)[0]) if known.any() else 0.0)


def _together(frame: RgbdFrame, pieces: Sequence[Piece], size_m: Array) -> list[Piece]:
    """Return the pieces, the largest first; one that fits into one object with an earlier piece is joined to it."""
    assert frame.depth_m is not None
    joined: list[tuple[Piece, Array]] = []
    for piece in pieces:
        points_m = piece_points_m(frame, replace(piece, mask=inner(piece.mask)))
        for index, (other, others_m) in enumerate(joined):
            both_m = np.concatenate([others_m, points_m])
            if _fits(both_m, size_m):
                one, two = (item.mask_in(0, 0, frame.depth_m.shape) for item in (piece, other))
                joined[index] = (trimmed(0, 0, one | two, frame.depth_m), both_m)
                break
        else:
            joined.append((piece, points_m))
    return [piece for piece, _ in joined]


def _fits(points_m: Array, size_m: Array) -> bool:
    """Return whether all points fit into an upright object of the size, within the tolerance for noise."""
    if not len(points_m):
        return False
    low, high = quantiles(points_m, 0.02, 0.98)
    (*level_m, up_m), most_m = high - low, np.array([np.hypot(*size_m[:2]), size_m[2]])
    return bool(([np.hypot(*level_m), up_m] < SLACK_FACTOR * most_m + SLACK_M).all())


def quantiles(values: npt.NDArray[P], *shares: float) -> npt.NDArray[P]:
    """Return the quantiles (len(shares), ...) of values (N, ...); numpy's function takes four times as long."""
    ordered: npt.NDArray[P] = np.sort(values, axis=0)
    return ordered[[round(share * (len(values) - 1)) for share in shares]]


def window(image: npt.NDArray[P], left_px: int, top_px: int, shape: tuple[int, ...]) -> npt.NDArray[P]:
    """Return a window (h, w) of an image, padded with 0 outside of the image."""
    part = np.zeros(shape, image.dtype)
    left, right = max(left_px, 0), min(left_px + shape[1], image.shape[1])
    top, bottom = max(top_px, 0), min(top_px + shape[0], image.shape[0])
    part[top - top_px : bottom - top_px, left - left_px : right - left_px] = image[top:bottom, left:right]
    return part


def inner(mask: Bools) -> Bools:
    """Return the mask without its rim, where depths mix; the whole mask if little would remain."""
    core = eroded(mask, SQUARE)
    return core if np.count_nonzero(core) > 0.3 * np.count_nonzero(mask) else mask


def eroded(mask: Bools, kernel: Bytes) -> Bools:
    """Return the eroded mask; pixels beyond its border count as empty."""
    core = cv2.erode(mask.view(np.uint8), kernel, borderType=cv2.BORDER_CONSTANT, borderValue=(0,))
    return core.view(np.bool_)


def piece_points_m(frame: RgbdFrame, piece: Piece) -> Array:
    """Return the world points (N, 3) of the piece's pixels with known depth."""
    assert frame.depth_m is not None
    height, width = piece.mask.shape
    depth_m = frame.depth_m[piece.top_px : piece.top_px + height, piece.left_px : piece.left_px + width]
    rows, columns = np.nonzero(piece.mask & (depth_m > 0))
    return frame.camera.deproject(rows + piece.top_px, columns + piece.left_px, depth_m[rows, columns])
