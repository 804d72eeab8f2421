"""What is known of an object's shape as lines to be drawn, in the object's frame."""

from itertools import product

import numpy as np

from app.perception.cuboid_model import CuboidModel
from app.perception.marker_model import Marker, MarkersModel
from app.perception.object_model import ObjectModel
from app.pipeline.arrays import Array
from app.pipeline.geometry import transform_points

CIRCLE_POINTS = 24
CYLINDER_SIDES = 4
_SQUARE = np.array([[-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0], [-0.5, -0.5, 0], [-0.5, 0.5, 0]])


def outlines(model: ObjectModel | None) -> list[Array]:
    """Polylines, each (N, 3) in metres; none for a model that knows no shape."""
    if isinstance(model, CuboidModel):
        lines = _cylinder() if model.shape == "cylinder" else _box()
        return [line * model.size_m - model.origin_m for line in lines]
    if isinstance(model, MarkersModel):
        return [_marker(marker) for marker in model.markers]
    return []


def _box() -> list[Array]:
    """The 12 edges of a cube of side 1."""
    corners = np.array(list(product((-0.5, 0.5), repeat=3)))
    return [np.array([a, b]) for i, a in enumerate(corners) for b in corners[i + 1 :] if (a != b).sum() == 1]


def _cylinder() -> list[Array]:
    """The rims and some sides of a cylinder of diameter and height 1."""
    turns = np.linspace(0, 2 * np.pi, CIRCLE_POINTS + 1)
    rim = np.stack([np.cos(turns), np.sin(turns), np.ones_like(turns)], axis=1) / 2
    low = rim * (1, 1, -1)
    sides = [np.array([low[i], rim[i]]) for i in range(0, CIRCLE_POINTS, CIRCLE_POINTS // CYLINDER_SIDES)]
    return [rim, low, *sides]


def _marker(marker: Marker) -> Array:
    return transform_points(np.array(marker.marker_to_object), marker.size_m * _SQUARE)
