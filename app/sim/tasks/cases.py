"""A case of boards, open in front: the body of a safe, a cupboard, a chest of drawers."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from app.sim.scene import Part

BOARD_M = 0.008


def add_case(
    part: Part,
    colour: str,
    heights_m: Sequence[float],
    *,
    depth_m: float,
    half_width_m: float,
    front_m: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> None:
    """Boards, back and side walls; x points inside.

    Args:
        heights_m: of the boards' upper sides above `front_m`, the lowest (0) first, the top last.
        front_m: (3,) the middle of the lowest board's front edge, on the board, in the part's frame.
    """
    half_depth, half_board = depth_m / 2, BOARD_M / 2
    middle = (heights_m[0] + heights_m[-1] - BOARD_M) / 2
    half_height = (heights_m[-1] - heights_m[0]) / 2
    front = np.asarray(front_m)
    for height in heights_m:
        at_m = front + np.array([half_depth, 0, height - half_board])
        part.box((half_depth, half_width_m, half_board), colour, at_m=at_m)
    for y_m in (-half_width_m, half_width_m):
        part.box((half_depth, half_board, half_height), colour, at_m=front + np.array([half_depth, y_m, middle]))
    part.box((half_board, half_width_m, half_height), colour, at_m=front + np.array([depth_m, 0, middle]))
