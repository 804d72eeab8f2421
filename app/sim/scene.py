"""Building blocks of task scenes: bodies from boxes, cylinders and capsules, with joints, at random places."""

from collections.abc import Mapping, Sequence
from typing import Self, TypedDict, Unpack

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.sim.world import OBJECT_CONTACT
from roboprompt_client.types.arrays import Array

COLORS = {
    "red": (0.85, 0.10, 0.10),
    "green": (0.10, 0.65, 0.15),
    "blue": (0.10, 0.22, 0.85),
    "yellow": (0.95, 0.80, 0.05),
    "white": (0.92, 0.92, 0.92),
    "grey": (0.45, 0.45, 0.48),
    "black": (0.12, 0.12, 0.13),
    "wood": (0.58, 0.38, 0.20),
    "purple": (0.50, 0.10, 0.60),
    "orange": (0.95, 0.50, 0.05),
    "cyan": (0.10, 0.75, 0.80),
    "pink": (0.95, 0.50, 0.70),
}
# Stiff contacts: solids sink into each other by less than 0.1 mm under their own weight
CONTACT_SOLREF, CONTACT_SOLIMP = (0.006, 1.0), (0.95, 0.99, 0.001, 0.5, 2.0)
TORSIONAL_FRICTION, ROLLING_FRICTION = 0.005, 0.0001
NO_CONTACT = {"contype": 0, "conaffinity": 0}
NO_TURN = Rotation.identity()
BOARD_M = 0.008  # thickness of the boards of safes, cupboards and cabinets
MAX_PLACEMENT_TRIALS = 10_000

Vector = tuple[float, float, float]
Point2 = tuple[float, float]


class Shape(TypedDict, total=False):
    """Options of a rigid shape: its pose in the body's frame, its weight, its friction."""

    at_m: npt.ArrayLike
    rotation: Rotation
    mass_kg: float
    friction: float


class SceneBody:
    """A body under construction in a mujoco.MjSpec. Methods return the part, so that calls chain.

    Args:
        parent: the body to attach to: `spec.worldbody` or another part's `body`.
        position_m: (3,) in the parent's frame.
        free: whether it moves freely; only directly under the world.
    """

    def __init__(
        self,
        parent: mujoco.MjsBody,
        name: str,
        position_m: npt.ArrayLike,
        rotation: Rotation = NO_TURN,
        *,
        free: bool = False,
    ) -> None:
        self.body = parent.add_body(name=name, pos=position_m, quat=rotation.as_quat(scalar_first=True))
        if free:
            self.body.add_freejoint()

    def box(self, half_sizes_m: Vector, color: str, **shape: Unpack[Shape]) -> Self:
        return self._geom(mujoco.mjtGeom.mjGEOM_BOX, half_sizes_m, color, **shape)

    def cylinder(self, radius_m: float, half_height_m: float, color: str, **shape: Unpack[Shape]) -> Self:
        return self._geom(mujoco.mjtGeom.mjGEOM_CYLINDER, (radius_m, half_height_m, 0), color, **shape)

    def capsule(self, radius_m: float, half_length_m: float, color: str, **shape: Unpack[Shape]) -> Self:
        """Along z; `half_length_m` without the caps."""
        return self._geom(mujoco.mjtGeom.mjGEOM_CAPSULE, (radius_m, half_length_m, 0), color, **shape)

    def sphere(self, radius_m: float, color: str, **shape: Unpack[Shape]) -> Self:
        return self._geom(mujoco.mjtGeom.mjGEOM_SPHERE, (radius_m, 0, 0), color, **shape)

    def mark(self, half_sizes_m: Vector, color: str, **shape: Unpack[Shape]) -> Self:
        """A box that is seen but not felt, e.g. a colored place on the table."""
        return self._geom(mujoco.mjtGeom.mjGEOM_BOX, half_sizes_m, color, contact=NO_CONTACT, **shape)

    def wall(
        self,
        color: str,
        *,
        bottom_m: float,
        top_m: float,
        bottom_radius_m: float,
        top_radius_m: float | None = None,
        thickness_m: float = 0.003,
        facets: int = 16,
        mass_kg: float = 0.05,
        friction: float = 0.6,
    ) -> Self:
        """A round wall about the z axis, hollow inside, of flat facets: a tube, or a cone if the radii differ.

        Radii are measured to the middle of the facets' thickness; the first facet faces x.
        """
        top_radius_m = bottom_radius_m if top_radius_m is None else top_radius_m
        rise_m, flare_m = top_m - bottom_m, top_radius_m - bottom_radius_m
        half_width_m = np.tan(np.pi / facets) * max(bottom_radius_m, top_radius_m)
        half_sizes_m = (thickness_m / 2, half_width_m, np.hypot(rise_m, flare_m) / 2)
        lean = Rotation.from_euler("y", np.arctan2(flare_m, rise_m))
        middle_m = [(bottom_radius_m + top_radius_m) / 2, 0, (bottom_m + top_m) / 2]
        for facet in range(facets):
            turn = about_z(2 * np.pi * facet / facets)
            shape = Shape(at_m=turn.apply(middle_m), rotation=turn * lean, mass_kg=mass_kg / facets, friction=friction)
            self.box(half_sizes_m, color, **shape)
        return self

    def case(
        self,
        color: str,
        heights_m: Sequence[float],
        *,
        depth_m: float,
        half_width_m: float,
        front_m: npt.ArrayLike = (0.0, 0.0, 0.0),
    ) -> Self:
        """Boards, back and side walls of a safe, a cupboard or a cabinet, open in front; x points inside.

        Args:
            heights_m: of the boards' upper sides above `front_m`, the lowest (0) first, the top last.
            front_m: (3,) the middle of the lowest board's front edge, on the board.
        """
        half_depth, half_board = depth_m / 2, BOARD_M / 2
        middle = (heights_m[0] + heights_m[-1] - BOARD_M) / 2
        half_height = (heights_m[-1] - heights_m[0]) / 2
        front = np.asarray(front_m)
        for height in heights_m:
            at_m = front + np.array([half_depth, 0, height - half_board])
            self.box((half_depth, half_width_m, half_board), color, at_m=at_m)
        for y_m in (-half_width_m, half_width_m):
            self.box((half_depth, half_board, half_height), color, at_m=front + np.array([half_depth, y_m, middle]))
        return self.box((half_board, half_width_m, half_height), color, at_m=front + np.array([depth_m, 0, middle]))

    def _geom(
        self,
        kind: mujoco.mjtGeom,
        size: Vector,
        color: str,
        *,
        at_m: npt.ArrayLike = (0.0, 0.0, 0.0),
        rotation: Rotation = NO_TURN,
        mass_kg: float = 0.05,
        friction: float = 0.6,
        contact: Mapping[str, int] = OBJECT_CONTACT,
    ) -> Self:
        """One rigid shape of the body, at a position and rotation in its frame."""
        self.body.add_geom(
            type=kind,
            size=size,
            pos=at_m,
            quat=rotation.as_quat(scalar_first=True),
            rgba=[*COLORS[color], 1],
            mass=mass_kg,
            friction=[friction, TORSIONAL_FRICTION, ROLLING_FRICTION],
            solref=CONTACT_SOLREF,
            solimp=CONTACT_SOLIMP,
            **contact,
        )
        return self

    def slide(
        self,
        name: str,
        axis: Vector,
        range_m: tuple[float, float],
        *,
        damping: float,
        dry_friction_n: float = 0.0,
        spring_n_m: float = 0.0,
        spring_rest_m: float = 0.0,
    ) -> Self:
        """A sliding joint towards the parent; it starts at 0."""
        self.body.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=axis,
            range=range_m,
            limited=1,
            armature=0.001,
            damping=[damping, 0, 0],
            frictionloss=dry_friction_n,
            stiffness=[spring_n_m, 0, 0],
            springref=spring_rest_m,
        )
        return self

    def hinge(
        self,
        name: str,
        axis: Vector,
        range_rad: tuple[float, float],
        *,
        dry_friction_nm: float,
    ) -> Self:
        """A turning joint towards the parent, about an axis through the body's origin; it starts at 0."""
        self.body.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=axis,
            range=range_rad,
            limited=1,
            armature=0.001,
            damping=[0.02, 0, 0],
            frictionloss=dry_friction_nm,
        )
        return self

    def ball(self, *, damping: float, spring_nm_rad: float) -> Self:
        """A joint that turns every way about the body's origin and springs back to how it was built."""
        self.body.add_joint(type=mujoco.mjtJoint.mjJNT_BALL, damping=[damping, 0, 0], stiffness=[spring_nm_rad, 0, 0])
        return self


def scatter(
    random: np.random.Generator,
    count: int,
    low_m: Point2,
    high_m: Point2,
    min_distance_m: float,
    clear_of: Sequence[tuple[Array, float]] = (),
) -> list[Array]:
    """`count` points (2,), uniform in a rectangle, with a least distance between any two.

    Args:
        clear_of: places (2,) that are taken, each with the least distance that a point keeps from it, m.
    """
    points: list[Array] = []
    for _ in range(MAX_PLACEMENT_TRIALS):
        point = random.uniform(low_m, high_m)
        taken = [*clear_of, *((other, min_distance_m) for other in points)]
        if all(np.linalg.norm(point - place) >= distance_m for place, distance_m in taken):
            points.append(point)
        if len(points) == count:
            return points
    raise ValueError(f"{count} points at least {min_distance_m} m apart do not fit between {low_m} and {high_m}")


def about_z(yaw_rad: float) -> Rotation:
    """A turn about the vertical."""
    return Rotation.from_euler("z", yaw_rad)
