"""When a gripper was open, by the measured distance of its fingers."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from roboprompt_client.types.arrays import Array

MIN_TRAVEL_M = 0.005  # fingers that move less neither opened nor closed
RELEASED_SHARE = 1 / 3  # of the way on which fingers closed; by less they give way to what they hold
SWING_SHARE = 0.1  # of the recording's travel: fingers that move less between two turns tremble, or their grasp slips


def open_by_width(widths_m: Array) -> npt.NDArray[np.bool_]:
    """Return (T,) whether the gripper is open: each time its fingers move, from the middle of their way on.

    A single threshold would miss a grasp of something wide in a recording that also has one of something narrow.

    Args:
        widths_m: (T,) between the fingers, at least two, which move by `MIN_TRAVEL_M` or more.
    """
    turns = _turns(widths_m, max(MIN_TRAVEL_M, SWING_SHARE * float(np.ptp(widths_m))))
    opened = np.empty(len(widths_m), np.bool_)
    state = bool(widths_m[turns[0]] > widths_m[turns[1]])
    begin = 0
    for start, end in pairwise(turns):
        passed = (widths_m[start : end + 1] > (widths_m[start] + widths_m[end]) / 2) != state
        switch = start + int(passed.argmax())
        opened[begin:switch] = state
        begin, state = switch, not state
    opened[begin:] = state
    return opened


def _turns(widths_m: Array, swing_m: float) -> list[int]:
    """Return the frames between which the widths rise or fall by a swing or more, by turns."""
    widths, turns, lowest, highest = widths_m.tolist(), list[int](), 0, 0
    rises: bool | None = None
    for frame, width_m in enumerate(widths):
        if width_m > widths[highest]:
            highest = frame
        if width_m < widths[lowest]:
            lowest = frame
        closed_m = 0.0 if rises is None else widths[turns[-1]] - widths[lowest]
        if rises is not False and widths[highest] - width_m >= swing_m:
            turns.append(highest)
            rises, lowest = False, frame
        elif rises is not True and width_m - widths[lowest] >= max(swing_m, RELEASED_SHARE * closed_m):
            turns.append(lowest)
            rises, highest = True, frame
    return [*turns, lowest if rises is False else highest]
