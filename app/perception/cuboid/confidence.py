"""The confidence of a fitted shape, and the reasons that lower it."""

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from app.perception.cuboid.fit import Fit
from app.perception.cuboid.measurements import Measurements
from app.perception.cuboid.model import Shape
from app.perception.cuboid.segmentation import SQUARE, Piece, window
from app.perception.cuboid.shape import YAW, outline_points_m, surface_distances_m
from app.perception.sightings import Sighting
from roboprompt_client.cameras.table import DEPTH_SIGMA_AT_1_M
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame

SURFACE_M = 0.006  # a point within this distance lies on the surface, without depth noise
DEPTH_SIGMAS = 3.0
ENOUGH_VISIBLE = 0.35  # share of the outline's area; a smaller visible share lowers the confidence
STRICTNESS = 3  # exponent: 80 % agreement gives a confidence of 0.5
RIVAL_COST = 3.0  # another yaw is as plausible if its cost is higher by less than this
RIVAL_FACTOR = 0.4
NOTED = 0.85  # the reason mentions shares below this
BORDER_PX = 2


def sighting_of_fit(frame: RgbdFrame, piece: Piece, data: Measurements, shape: Shape, fit: Fit) -> Sighting:
    """Return the pose of the fitted shape; its confidence compares the piece's pixels with those of the shape.

    These lower it: pixels outside of the shape's outline; pixels inside the outline that show something behind it or
    another color on it; depths off its surface; a small visible share; another yaw that fits as well. Occluders do not.
    """
    covered, own, contradicting = _shares(frame, piece, shape, fit.candidate)
    tolerance_m = SURFACE_M + DEPTH_SIGMAS * DEPTH_SIGMA_AT_1_M * piece.distance_m**2
    on_surface = float((np.abs(surface_distances_m(shape, fit.candidate[None], data.points_m)) < tolerance_m).mean())
    shares = {
        "of its pixels lie inside the outline of the fitted shape": own,
        "of the fitted shape's visible area has its color": 1 - contradicting,
        "of its depths lie on the fitted shape": on_surface,
        "of it is visible": covered,
    }
    notes = [f"only {100 * share:.0f} % {what}" for what, share in shares.items() if share < NOTED]
    agreement = own * (1 - contradicting) * on_surface
    confidence = agreement**STRICTNESS * min(1.0, covered / ENOUGH_VISIBLE)
    yaw = fit.candidate[YAW]
    if shape == "box" and fit.rival_cost - fit.cost < RIVAL_COST:
        confidence *= RIVAL_FACTOR
        notes.append(f"yaws {np.degrees(yaw):.0f} and {np.degrees(fit.rival_yaw_rad):.0f} degrees fit alike")
    quaternion = Rotation.from_euler("z", yaw).as_quat(canonical=True)
    return Sighting(frame.camera.name, fit.candidate[:3], quaternion, float(confidence), ", ".join(notes))


def _shares(frame: RgbdFrame, piece: Piece, shape: Shape, candidate: Array) -> tuple[float, float, float]:
    """Return the visible share of the outline's area, the share of the piece inside it, the contradicting share.

    The last is relative to the area without occluders. The latter two ignore one pixel about the outline.
    """
    assert frame.depth_m is not None
    corners, _ = frame.camera.project(outline_points_m(shape, candidate))
    hull = cv2.convexHull(np.round(corners).astype(np.int32))[:, 0]
    low = np.minimum(hull.min(axis=0), (piece.left_px, piece.top_px)) - BORDER_PX
    high = np.maximum(hull.max(axis=0), (piece.left_px + piece.mask.shape[1], piece.top_px + piece.mask.shape[0]))
    width, height = np.minimum(high - low + BORDER_PX, 4 * max(frame.depth_m.shape))
    canvas = np.zeros((height, width), np.uint8)
    cv2.fillConvexPoly(canvas, hull - low.astype(np.int32), 1)
    filled = canvas > 0
    left, top = low.tolist()
    mask, depth_m = piece.mask_in(left, top, canvas.shape), window(frame.depth_m, left, top, canvas.shape)
    common = int(np.count_nonzero(filled & mask))
    rows, columns = np.nonzero(filled & ~mask & (depth_m > 0))
    points_m = frame.camera.deproject(rows + top, columns + left, depth_m[rows, columns])
    apart = surface_distances_m(shape, candidate[None], points_m)[0] > SURFACE_M
    before = apart & (depth_m[rows, columns] < frame.camera.project(candidate[:3])[1])
    rim = (filled & (cv2.erode(canvas, SQUARE) == 0))[rows, columns]  # the outline's outermost pixels
    wrong = int(np.count_nonzero(~before & ~rim))
    inside = int(np.count_nonzero(mask & (cv2.dilate(canvas, SQUARE) > 0)))
    areas = [max(int(np.count_nonzero(pixels)), 1) for pixels in (filled, mask)]
    return common / areas[0], inside / areas[1], wrong / max(wrong + common, 1)
