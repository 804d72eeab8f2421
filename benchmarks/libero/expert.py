"""A scripted expert for LIBERO's tasks in which things are taken and put somewhere, one after the other.

What is narrow is taken over its narrow side from above; a bowl, a mug or a plate by its rim. Only where things are and
how far they reach decides what it does.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.libero.scene import Extent, Scene
from benchmarks.robosuite.arm import Floats
from roboprompt_client.types.poses import EndEffectorAction

PUTS = ("on", "in")  # LIBERO's relations that are reached by putting something down
DOWN = Rotation.from_euler("x", np.pi)  # the fingers close along x
WIDEST_M = 0.072  # what the fingers get around
YAWS_RAD = np.radians(np.arange(0, 180, 3.0))
DEPTH_M, LEAST_HEIGHT_M = 0.03, 0.012  # of the grip below the top, and above the bottom
RIM_M, RIM_DEPTH_M = 0.008, 0.028  # from the outer edge into the wall, and below it
ABOVE_M, CARRIED_M = 0.12, 0.2
LET_GO_M = {"on": 0.012, "in": 0.06}  # so far above the place
EDGE_RAD = np.pi / 2  # where the rim is taken, from the x axis


@dataclass(frozen=True)
class Grasp:
    """Where a thing is held: the hand (3,), its rotation, and how far the thing's middle and bottom are from it."""

    position_m: Floats
    rotation: Rotation
    middle_m: Floats
    bottom_m: float


def plan(scene: Scene) -> list[EndEffectorAction]:
    """Return the expert's poses.

    Raises:
        NotImplementedError: for a task that needs more than putting things somewhere.
    """
    return [action for relation, *names in scene.goals for action in _moved(scene, relation, *names)]


def _moved(scene: Scene, relation: str, *names: str) -> Iterator[EndEffectorAction]:
    if relation not in PUTS:
        raise NotImplementedError(f"{relation} {names}")
    moved, target = names
    held = _grasp(scene.extent(moved), scene.hand)
    place_m = scene.place_m(target)
    over_m = np.append(place_m[:2] - held.middle_m, place_m[2] + held.bottom_m + LET_GO_M[relation])
    carried_m = max(held.position_m[2], over_m[2]) + CARRIED_M - ABOVE_M
    yield _action(held.position_m + _up(ABOVE_M), held.rotation)
    yield _action(held.position_m, held.rotation)
    yield _action(held.position_m, held.rotation, is_open=False)
    yield _action(_at_height(held.position_m, carried_m + ABOVE_M), held.rotation, is_open=False)
    yield _action(_at_height(over_m, carried_m + ABOVE_M), held.rotation, is_open=False)
    yield _action(over_m, held.rotation, is_open=False)
    yield _action(over_m, held.rotation)
    yield _action(over_m + _up(ABOVE_M), held.rotation)


def _grasp(extent: Extent, hand: Rotation) -> Grasp:
    widths_m = extent.widths_m(YAWS_RAD)
    narrowest = int(widths_m.argmin())
    if widths_m[narrowest] < WIDEST_M:
        across_rad, aside_m = float(YAWS_RAD[narrowest]), np.zeros(2)
        height_m = max(extent.top_m - DEPTH_M, extent.bottom_m + LEAST_HEIGHT_M)
    else:
        across_rad = EDGE_RAD
        radius_m = float(extent.widths_m(np.array([across_rad]))[0]) / 2 - RIM_M
        aside_m = radius_m * np.array([np.cos(across_rad), np.sin(across_rad)])
        height_m = extent.top_m - RIM_DEPTH_M
    turned = (Rotation.from_euler("z", across_rad + half) * DOWN for half in (0.0, np.pi))
    rotation = min(turned, key=lambda way: float((way * hand.inv()).magnitude()))
    position_m = np.append(extent.middle_m + aside_m, height_m)
    return Grasp(position_m, rotation, -aside_m, height_m - extent.bottom_m)


def _at_height(place_m: Floats, height_m: float) -> Floats:
    return np.array([place_m[0], place_m[1], height_m])


def _up(height_m: float) -> Floats:
    return np.array([0.0, 0.0, height_m])


def _action(position_m: Floats, hand: Rotation, *, is_open: bool = True) -> EndEffectorAction:
    return EndEffectorAction(position_m, hand.as_quat(), is_open)
