"""How near a straight way comes to an axis-aligned box."""

import math
from collections.abc import Sequence

Point = Sequence[float]


def passes_through(start_m: Point, end_m: Point, min_m: Point, max_m: Point) -> bool:
    """Whether any point of the way from `start_m` to `end_m`, both (3), lies inside the box; its faces do not count.

    Args:
        min_m, max_m: (3) opposite corners of the box.
    """
    entry, leave = -math.inf, math.inf
    for start, end, low, high in zip(start_m, end_m, min_m, max_m, strict=True):
        if (step := end - start) == 0:
            if not low < start < high:
                return False
            continue
        one, other = (low - start) / step, (high - start) / step
        entry, leave = max(entry, min(one, other)), min(leave, max(one, other))
    return entry < leave and entry < 1 and leave > 0


def clearance_m(start_m: Point, end_m: Point, min_m: Point, max_m: Point) -> float:
    """The least distance between the way from `start_m` to `end_m`, both (3), and the box; 0 if they touch.

    The squared distance along the way is convex and consists of parabolas that meet where the way crosses the planes of
    the box's faces, so that its minimum is exact.
    """
    steps = [end - start for start, end in zip(start_m, end_m, strict=True)]
    axes = list(zip(start_m, steps, min_m, max_m, strict=True))

    def beyond(part: float) -> list[float]:
        places = [(start + part * step, low, high) for start, step, low, high in axes]
        return [place - high if place > high else min(place - low, 0.0) for place, low, high in places]

    def slope(part: float) -> float:
        return sum(away * step for away, step in zip(beyond(part), steps, strict=True))

    before, rising_before = 0.0, slope(0.0)
    if rising_before >= 0:
        return math.hypot(*beyond(0.0))
    for part in _crossings(axes):
        if (rising := slope(part)) >= 0:
            nearest = before + (part - before) * rising_before / (rising_before - rising)
            return math.hypot(*beyond(nearest))
        before, rising_before = part, rising
    return math.hypot(*beyond(1.0))


def _crossings(axes: list[tuple[float, float, float, float]]) -> list[float]:
    """Which parts (0..1] of the way end at the planes of the box's faces, and the whole; ascending."""
    parts = [(face - start) / step for start, step, *faces in axes if step != 0 for face in faces]
    return [*sorted(part for part in parts if 0 < part < 1), 1.0]
