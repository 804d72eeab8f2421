import numpy as np

from app.perception.cuboid.model import COLORS, ColorModel
from app.perception.cuboid.segmentation import color_mask, find_parts, find_pieces, to_hsv
from tests.perception.solid_scene import Solid, cube, shoot

CUBE_M = np.full(3, 0.05)


def mask_of(frame, color="red"):
    return color_mask(to_hsv(frame.rgb), ColorModel(COLORS[color]))


def test_two_that_touch_in_the_image_are_parted_by_depth():
    # seen from (0.6, 0.5, 0.7), one behind the other
    frame = shoot([cube("red", 0.04, 0.035), cube("red", -0.04, -0.035)])
    pieces = find_pieces(frame, mask_of(frame), CUBE_M, "box")
    assert len(pieces) == 2
    for piece in pieces:
        ids = frame.mask[piece.mask_in(0, 0, frame.mask.shape)]
        assert np.bincount(ids).max() > 0.95 * len(ids)


def test_one_that_a_pole_divides_is_put_together():
    pole = Solid("grey", (0.05, 0.045, 0.06), 0, (0.012, 0.012, 0.12), round=True)
    frame = shoot([cube("red", 0, 0, 0.3), pole])
    assert len(find_parts(frame, mask_of(frame))) == 2
    (piece,) = find_pieces(frame, mask_of(frame), CUBE_M, "box")
    assert piece.num_pixels > 0.95 * np.count_nonzero(frame.mask == 1)


def test_specks_and_what_is_far_too_small_are_nothing():
    frame = shoot([Solid("red", (0, 0, 0.004), 0, (0.008, 0.008, 0.008))])
    mask = mask_of(frame)
    assert np.count_nonzero(mask) > 20
    assert find_pieces(frame, mask, CUBE_M, "box") == []
    speckled = np.zeros_like(mask)
    speckled[::7, ::7] = 255
    assert find_pieces(frame, speckled, CUBE_M, "box") == []
    assert find_pieces(frame, np.zeros_like(mask), CUBE_M, "box") == []


def test_pixels_without_depth_are_no_piece():
    frame = shoot([cube("red", 0, 0)])
    mask = mask_of(frame)
    frame.depth_m[mask > 0] = 0
    assert find_pieces(frame, mask, CUBE_M, "box") == []
