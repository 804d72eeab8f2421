"""An object's size and where its origin lies in it, from one labelled view."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery
from app.perception.color import color_mask, to_hsv
from app.perception.cuboid_fit import fit_any_size
from app.perception.cuboid_model import ColorModel
from app.perception.cuboid_view import view_of
from app.perception.pieces import Piece, find_parts, full_mask
from app.perception.upright_shape import SX, YAW, Shape
from app.pipeline.arrays import Array
from app.pipeline.camera import RgbdFrame
from app.pipeline.geometry import yaw_rad


@dataclass(frozen=True, eq=False)
class Measured:
    """What one view says of an object.

    Attributes:
        size_m: (3,) full lengths along the object's axes.
        origin_m: (3,) its origin from the middle of its shape, in its axes; None where its position is not known.
        cost: of the fit, per residual.
    """

    size_m: Array
    origin_m: Array | None
    cost: float


def measure(
    frame: RgbdFrame, query: ObjectQuery, pixels: npt.NDArray[np.bool_], color: ColorModel, shape: Shape
) -> Measured | None:
    """Fit a shape of free size to the patch of the colour that shares most pixels with the labelled ones."""
    assert frame.rgb is not None
    piece = _piece_at(frame, pixels, color)
    if piece is None:
        return None
    view = view_of(frame, piece)
    fit = fit_any_size(view, shape)
    size_m, turn = _along_axes(fit.candidate, query, shape)
    origin_m = None
    if query.position_m is not None:
        origin_m = turn.inv().apply(np.array(query.position_m) - fit.candidate[:3])
        if query.quaternion_xyzw is None:
            origin_m[:2] = 0.0
    return Measured(size_m, origin_m, fit.cost / (len(view.points_m) + len(view.rays)))


def _piece_at(frame: RgbdFrame, pixels: npt.NDArray[np.bool_], color: ColorModel) -> Piece | None:
    assert frame.rgb is not None
    pieces = find_parts(frame, color_mask(to_hsv(frame.rgb), color))
    shares = [int(np.count_nonzero(full_mask(piece, pixels.shape) & pixels)) for piece in pieces]
    return pieces[int(np.argmax(shares))] if any(shares) else None


def _along_axes(candidate: Array, query: ObjectQuery, shape: Shape) -> tuple[Array, Rotation]:
    """The size along the object's own axes, and their turn; where they are not known, x is the longer side."""
    size_m, yaw = candidate[SX:].copy(), float(candidate[YAW])
    if query.quaternion_xyzw is not None:
        own = yaw_rad(Rotation.from_quat(query.quaternion_xyzw))
        swapped = shape == "box" and round((own - yaw) / (np.pi / 2)) % 2 == 1
    else:
        own, swapped = yaw, size_m[1] > size_m[0]
    return (size_m[[1, 0, 2]] if swapped else size_m), Rotation.from_euler("z", own)
