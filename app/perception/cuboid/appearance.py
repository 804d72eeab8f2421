"""An object's color, size and origin, measured in labeled views."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery
from app.perception.cuboid.fit import fit_any_size
from app.perception.cuboid.measurements import measure_piece
from app.perception.cuboid.model import ColorModel, Shape
from app.perception.cuboid.segmentation import SQUARE, Bools, color_mask, find_parts, to_hsv
from app.perception.cuboid.shape import SX, YAW
from app.perception.object_model import ObjectModelError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.quaternions import yaw_rad

MIN_SATURATION = 0.3  # the hue of paler pixels is noise
HUE_BIN_DEG = 5.0
PEAK_REACH_DEG = 30.0
HUE_MARGIN_DEG, SATURATION_MARGIN, VALUE_FACTOR = 8.0, 0.15, 0.5  # for light unlike the demonstrations'
MAX_LEAST_VALUE = 0.2  # so that a color learned from a lit side includes shaded sides
SEED_REACH_PX = 4
SEED_BEHIND_M = 0.015


def object_pixels(frame: RgbdFrame, query: ObjectQuery) -> Bools:
    """Return the object's pixels (H, W): those of its mask ids, else a few around its position; perhaps none."""
    assert frame.depth_m is not None
    if query.mask_ids and frame.mask is not None:
        return np.isin(frame.mask, query.mask_ids) & (frame.depth_m > 0)
    pixels = np.zeros(frame.depth_m.shape, np.bool_)
    if query.position_m is None:
        return pixels
    (height, width), (pixel, distance_m) = frame.depth_m.shape, frame.camera.project(query.position_m)
    if distance_m <= 0 or not (0 <= round(pixel[0]) < width and 0 <= round(pixel[1]) < height):
        return pixels
    column, row = round(pixel[0]), round(pixel[1])
    reach = np.s_[
        max(row - SEED_REACH_PX, 0) : row + SEED_REACH_PX + 1,
        max(column - SEED_REACH_PX, 0) : column + SEED_REACH_PX + 1,
    ]
    pixels[reach] = (frame.depth_m[reach] > 0) & (frame.depth_m[reach] < distance_m + SEED_BEHIND_M)
    return pixels


def learn_color(name: str, seen: Sequence[tuple[RgbdFrame, Bools]]) -> ColorModel:
    """Return the color of most saturated pixels, with a margin for changes of light.

    Raises:
        ObjectModelError: if the object `name` has no color that stands out.
    """
    samples = np.concatenate([_samples(frame, pixels) for frame, pixels in seen])
    strong = samples[samples[:, 1] > MIN_SATURATION]
    if len(strong) < 0.2 * len(samples) or len(strong) < 10:
        share = f"only {100 * len(strong) / len(samples):.0f} % of its pixels have a color (saturation over 0.3)"
        raise ObjectModelError(name, share, "a colored object, markers on it, or masks")
    counts, edges = np.histogram(strong[:, 0], np.arange(0, 360 + HUE_BIN_DEG, HUE_BIN_DEG))
    smooth = counts + np.roll(counts, 1) + np.roll(counts, -1)
    peak_deg = edges[np.argmax(smooth)] + HUE_BIN_DEG / 2
    offsets_deg = (strong[:, 0] - peak_deg + 180) % 360 - 180
    near = np.abs(offsets_deg) < PEAK_REACH_DEG
    (low, high), least = np.percentile(offsets_deg[near], [2, 98]), np.percentile(strong[near, 1:], 2, axis=0)
    hue_deg = ((peak_deg + low - HUE_MARGIN_DEG) % 360, (peak_deg + high + HUE_MARGIN_DEG) % 360)
    saturation = max(least[0] - SATURATION_MARGIN, MIN_SATURATION)
    return ColorModel(
        (round(float(hue_deg[0]), 1), round(float(hue_deg[1]), 1)),
        (round(float(saturation), 3), 1.0),
        (round(float(min(least[1] * VALUE_FACTOR, MAX_LEAST_VALUE)), 3), 1.0),
    )


def _samples(frame: RgbdFrame, pixels: Bools) -> Array:
    """Return hue in degrees, saturation and value in 0..1 (N, 3) of the pixels, without their rim if enough remain."""
    assert frame.rgb is not None
    inner = cv2.erode(pixels.astype(np.uint8), SQUARE) > 0
    chosen = inner if np.count_nonzero(inner) > 30 else pixels
    samples: Array = to_hsv(frame.rgb[chosen][None])[0] * np.array([360 / 256, 1 / 255, 1 / 255])
    return samples


@dataclass(frozen=True, eq=False)
class MeasuredShape:
    """The size and origin of an object, measured in one view.

    Attributes:
        size_m: (3,) full lengths along the object's axes.
        origin_m: (3,) its origin from the middle of its shape, in its axes; None where its position is not known.
        cost: of the fit, per residual.
    """

    size_m: Array
    origin_m: Array | None
    cost: float


def measure(
    frame: RgbdFrame, query: ObjectQuery, pixels: Bools, color: ColorModel, shape: Shape
) -> MeasuredShape | None:
    """Fit a shape of unknown size to the patch of the color that overlaps the labeled pixels most."""
    assert frame.rgb is not None
    pieces = find_parts(frame, color_mask(to_hsv(frame.rgb), color))
    shares = [int(np.count_nonzero(piece.mask_in(0, 0, pixels.shape) & pixels)) for piece in pieces]
    if not any(shares):
        return None
    data = measure_piece(frame, pieces[int(np.argmax(shares))])
    fit = fit_any_size(data, shape)
    size_m, turn = _along_axes(fit.candidate, query, shape)
    origin_m = None
    if query.position_m is not None:
        origin_m = turn.inv().apply(np.array(query.position_m) - fit.candidate[:3])
        if query.quaternion_xyzw is None:
            origin_m[:2] = 0.0
    return MeasuredShape(size_m, origin_m, fit.cost / (len(data.points_m) + len(data.rays)))


def _along_axes(candidate: Array, query: ObjectQuery, shape: Shape) -> tuple[Array, Rotation]:
    """Return size and rotation of the object's own axes; without a given rotation, x is the longer side."""
    size_m, yaw = candidate[SX:].copy(), float(candidate[YAW])
    if query.quaternion_xyzw is not None:
        own = yaw_rad(query.quaternion_xyzw)
        swapped = shape == "box" and round((own - yaw) / (np.pi / 2)) % 2 == 1
    else:
        own, swapped = yaw, size_m[1] > size_m[0]
    return (size_m[[1, 0, 2]] if swapped else size_m), Rotation.from_euler("z", own)
