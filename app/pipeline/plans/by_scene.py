"""Chooses between several demonstrated plans: the plan whose demonstrated scenes are most similar to the scene.

Scenes are compared by the quantity that separates the plans: one coordinate or the yaw of an object, absolute or
relative to another object, if each plan has an interval of its own; or the positions of all objects, if the most
similar scene usually has the same plan. A permutation test rejects quantities that separate the plans by chance.
Without such a quantity the scene does not choose.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
import numpy.typing as npt

from app.pipeline.episode import Demonstration, rotation_of
from app.pipeline.groups import by_plan
from app.pipeline.plans.rows import plan_rows
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

PARTED_SHARE = 0.8  # the share of demonstrations that must lie in the interval of their plan
COMPARED = 3  # demonstrations of each plan whose actions are compared
SAME_ACT_M, SAME_ACT_DEG = 0.04, 20.0  # largest deviation from the mean of grasps and releases that are the same
SIGNIFICANCE = 0.05  # significance level of one quantity, over all quantities that are tried
SIGNIFICANCE_OF_ALL = 0.01  # of all positions together: five of ten recordings in a wrong frame must not pass
SHUFFLES = 1000  # permutations of the test
VARIES = {"m": 0.02, "deg": 10.0}  # quantities that vary by less separate nothing
NEAR = {"m": 0.03, "deg": 15.0}  # a scene within this distance of a demonstration counts as demonstrated
NEAR_SPACINGS = 2.0  # the same distance, in median spacings of the plan's demonstrations
FAR = {"m": 0.15, "deg": 45.0}  # a scene farther than this from every demonstration is outside of what they show
BETWEEN = 0.5  # of the distance to the nearest other plan: from here on a scene may belong to that plan


@dataclass(frozen=True)
class Quantity:
    """A quantity by which scenes are compared.

    Attributes:
        axis: 0 to 2: the object's x, y or z in meters; 3: its yaw in degrees; None: the positions of all objects.
        seen_from: the object relative to which the value is measured; empty: the world.
    """

    axis: int | None
    object_name: str = ""
    seen_from: str = ""

    @property
    def unit(self) -> str:
        """The unit of its values: `m` or `deg`."""
        return "deg" if self.axis == 3 else "m"

    @property
    def text(self) -> str:
        """Its name in messages."""
        if self.axis is None:
            return "the objects' places"
        seen = f" seen from {self.seen_from}" if self.seen_from else ""
        return f"the {('x', 'y', 'z', 'yaw')[self.axis]} of {self.object_name}{seen}"

    def of(self, objects: Sequence[ObjectPose]) -> Array:
        """Return its values (D,) in a scene."""
        if self.axis is None:
            return np.concatenate([pose.position_m for pose in objects])
        value = self._of(self.object_name, objects)
        return np.array([value - self._of(self.seen_from, objects) if self.seen_from else value])

    def _of(self, name: str, objects: Sequence[ObjectPose]) -> float:
        pose = next(pose for pose in objects if pose.name == name)
        if self.axis == 3:
            return math.degrees(quaternions.yaw_rad(rotation_of(pose)))
        return float(pose.position_m[self.axis or 0])

    def apart(self, one: Array, other: Array) -> Array:
        """Return the distances (...) between values (..., D)."""
        if self.axis is None:
            ways_m = (one - other).reshape(*np.broadcast_shapes(one.shape, other.shape)[:-1], -1, 3)
            between_m: Array = np.linalg.norm(ways_m, axis=-1).sum(axis=-1)
            return between_m
        off = (one - other)[..., 0]
        return np.abs((off + 180) % 360 - 180 if self.axis == 3 else off)


@dataclass(frozen=True, eq=False)
class Parting:
    """Demonstrations of equal instructions, and the quantity that separates their plans.

    Attributes:
        ways: (N,) the number of each demonstration's way, see `ways_of`.
        values: (N, D) of the quantity in the demonstrations.
        share: of the demonstrations that lie in the interval of their way.
        clear: the separation of the ways, see `_clear`.
    """

    demonstrations: tuple[Demonstration, ...]
    quantity: Quantity
    ways: Array
    values: Array
    share: float
    clear: float

    def near(self, way: int) -> float:
        """Return the distance from the nearest demonstration of a way within which a scene counts as demonstrated."""
        of_way = self.values[self.ways == way]
        between = self.quantity.apart(of_way[:, None], of_way[None])
        np.fill_diagonal(between, np.inf)
        spacing = float(np.median(between.min(axis=1))) if len(of_way) > 1 else 0.0
        return max(NEAR[self.quantity.unit], NEAR_SPACINGS * spacing)


def parting(demonstrations: Sequence[Demonstration]) -> Parting | None:
    """Return the quantity that separates the plans of demonstrations best.

    None if there is no such quantity or only one plan, or if the instructions name different objects or another order.
    """
    if len({demonstration.order.objects for demonstration in demonstrations}) != 1:
        return None
    ways = ways_of(demonstrations)
    if (np.bincount(ways) > 1).sum() < 2:
        return None
    quantities = _quantities(demonstrations)
    found = [_separation(demonstrations, ways, quantity, len(quantities)) for quantity in quantities]
    found.append(_separation(demonstrations, ways, Quantity(None)))
    return max((one for one in found if one is not None), key=lambda one: (one.share, one.clear), default=None)


def ways_of(demonstrations: Sequence[Demonstration]) -> Array:
    """Return the number (N,) of each demonstration's way; plans with equal grasps and releases are one way."""
    found: list[list[Demonstration]] = []
    for group in by_plan(demonstrations):
        alike = next((way for way in found if _act_alike([*way[:COMPARED], *group[:COMPARED]])), None)
        if alike is None:
            found.append(list(group))
        else:
            alike += group
    return np.array([next(k for k, way in enumerate(found) if one in way) for one in demonstrations])


def _act_alike(demonstrations: Sequence[Demonstration]) -> bool:
    """Return whether grasps and releases are the same relative to their anchors; false if there are none."""
    acting = [replace(shown, actions=tuple(shown.actions[k] for k in shown.switches)) for shown in demonstrations]
    grips = {tuple(action.gripper_open for action in shown.actions) for shown in acting}
    if len(grips) > 1 or grips == {()}:
        return False
    return all(row.off_deg.max() <= SAME_ACT_DEG and row.off_m.max() <= SAME_ACT_M for row in plan_rows(acting))


def _separation(
    demonstrations: Sequence[Demonstration], ways: Array, quantity: Quantity, tried: int = 1
) -> Parting | None:
    """Return the separation of the ways by a quantity; None if it is not significant in a permutation test.

    A single quantity separates ways that have an interval of its values each; the positions of all objects, if the most
    similar scene has the same way.

    Args:
        tried: the number of quantities of which the best is taken.
    """
    values = np.array([quantity.of(demonstration.objects) for demonstration in demonstrations])
    between = quantity.apart(values[:, None], values[None])
    np.fill_diagonal(between, np.inf)
    shares, level = partial(_shares_of_nearest, nearest=between.argmin(axis=1)), SIGNIFICANCE_OF_ALL
    if quantity.axis is not None:
        order = np.argsort(values[:, 0], kind="stable")
        shares, level = partial(_shares_in_intervals, order=order, is_circle=quantity.axis == 3), SIGNIFICANCE
    share = float(shares(ways))
    if share < PARTED_SHARE:
        return None
    clear = _clear(ways, between)
    shuffled = np.random.default_rng(0).permuted(np.tile(ways, (SHUFFLES, 1)), axis=1)
    as_clear = sum(_clear(others, between) >= clear for others in shuffled[shares(shuffled) >= share])
    if tried * (1 + as_clear) / (1 + SHUFFLES) > level:
        return None
    return Parting(tuple(demonstrations), quantity, ways, values, share, clear)


def _shares_of_nearest(ways: Array, nearest: Array) -> Array:
    """Return the least share (...) over the ways (..., N) of demonstrations whose nearest one has the same way."""
    same = ways == ways[..., nearest]
    members = [ways == way for way in np.unique(ways)]
    shares = [np.where(own.sum(-1) > 1, (same & own).sum(-1) / np.maximum(own.sum(-1), 1), 1.0) for own in members]
    least: Array = np.min(shares, axis=0)
    return least


def _shares_in_intervals(ways: Array, order: npt.NDArray[np.intp], *, is_circle: bool) -> Array:
    """Return the share (...) of the demonstrations that lie in the interval of their way (..., N).

    Args:
        order: (N,) that sorts the demonstrations by the quantity.
        is_circle: whether the last value is next to the first one.
    """
    ordered = ways[..., order]
    changes = (np.diff(ordered, axis=-1) != 0).sum(axis=-1)
    fewest = len(np.unique(ways)) - (not is_circle)
    if is_circle:
        changes = changes + (ordered[..., 0] != ordered[..., -1])
    shares: Array = 1 - (changes - fewest) / ways.shape[-1]
    return shares


def _clear(ways: Array, between: Array) -> float:
    """Return the mean of b / (a + b): a and b are the distances to the nearest of the same and of another way."""
    alike = ways[:, None] == ways[None]
    several = np.bincount(ways)[ways] > 1
    own, others = (np.where(which, between, np.inf).min(axis=1)[several] for which in (alike, ~alike))
    return float(np.mean(others / np.maximum(own + others, 1e-12)))


def _quantities(demonstrations: Sequence[Demonstration]) -> list[Quantity]:
    """Return coordinates and yaws of the objects that serve as anchors in some plan, and their differences in pairs."""
    rows = [row for group in by_plan(demonstrations) for row in plan_rows(group)]
    followed = {name for row in rows for anchor in row.anchors for name in anchor.names}
    poses = [pose for pose in demonstrations[0].objects if pose.name in followed]
    unturned = {pose.name for d in demonstrations for pose in d.objects if pose.quaternion_xyzw is None}
    single = [Quantity(axis, pose.name) for pose in poses for axis in range(3 + (pose.name not in unturned))]
    moving = [one for one in single if _varies(one, demonstrations)]
    pairs = [
        Quantity(one.axis, one.object_name, other.object_name)
        for one, other in combinations(moving, 2)
        if one.axis == other.axis
    ]
    return [*moving, *(pair for pair in pairs if _varies(pair, demonstrations))]


def _varies(quantity: Quantity, demonstrations: Sequence[Demonstration]) -> bool:
    values = np.array([quantity.of(demonstration.objects) for demonstration in demonstrations])
    return bool(quantity.apart(values, values[0]).max() > VARIES[quantity.unit])
