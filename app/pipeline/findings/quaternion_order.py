"""Quaternions with w first: refused where no correct recording looks like that, else a finding.

Read as x y z w, a rotation about the vertical with w first is a rotation about the x axis.
"""

from collections.abc import Callable, Iterator, Sequence
from operator import itemgetter

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import W_FIRST_OF_OBJECT
from app.pipeline.keyframes import Motion
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

UPRIGHT_DEG = 5.0
OFF_UPRIGHT_DEG = 20.0
DOWN_DEG = 10.0
APPROACH_M = 0.05  # before a grasp or release the hand moves along its own z axis
ALONG_DEG, ACROSS_DEG = 25.0, 60.0
ONE_TILT_DEG = 5.0  # tilts that differ by less are one
ON_ITS_HEAD_DEG = 135.0
MIN_TILTS = 3  # demonstrations from which on an object's tilts are compared
Misreading = tuple[str, list[int], Array]
# How else quaternions may have been meant: what they are then, the order of their numbers, and their signs
MISREADINGS: tuple[Misreading, ...] = (
    ("w first", [1, 2, 3, 0], np.ones(4)),
    ("inverted (world to hand)", [0, 1, 2, 3], np.array([-1.0, -1.0, -1.0, 1.0])),
    ("mirrored in x", [0, 1, 2, 3], np.array([1.0, -1.0, -1.0, 1.0])),
    ("mirrored in y", [0, 1, 2, 3], np.array([-1.0, 1.0, -1.0, 1.0])),
    ("mirrored in z", [0, 1, 2, 3], np.array([-1.0, -1.0, 1.0, 1.0])),
)
UP, DOWN = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])


def likeliest_meaning(
    quaternions: Array, off_deg: Callable[[Rotation], float], readings: Sequence[Misreading] = MISREADINGS
) -> tuple[str, float]:
    """Return how else quaternions (N, 4) were probably meant, because rotations are then least off, and by how much."""
    meant = ((off_deg(Rotation.from_quat(quaternions[:, order] * signs)), name) for name, order, signs in readings)
    least_deg, name = min(meant, key=itemgetter(0))
    return name, least_deg


def off_mean_deg(rotations: Rotation) -> Array:
    """Return (N,) angles from their mean."""
    off: Array = np.degrees((rotations.mean().inv() * rotations).magnitude())
    return off


def check_hand_order(motion: Motion) -> None:
    """Refuse a hand that would point straight down, or along its way to each grasp, if w came first.

    Raises:
        InvalidInputError: naming the field.
    """
    _check_approaches(motion)
    quaternions = motion.trajectory.quaternions_xyzw
    as_read, as_meant = _off_way_deg(quaternions, DOWN), _off_way_deg(_w_first(quaternions), DOWN)
    turns = np.abs(quaternions @ quaternions[0]).min() < np.cos(np.radians(DOWN_DEG / 2))
    if turns and as_meant.max() < DOWN_DEG and as_read.max() > OFF_UPRIGHT_DEG:
        message = "are a hand that points straight down only if w comes first"
        raise InvalidInputError("trajectory.end_effector_quaternions_xyzw", message, "order x y z w")


def _check_approaches(motion: Motion) -> None:
    """Refuse a hand that would move along its own z axis before each grasp and release if w came first.

    A hand that points down as given may move sideways before it closes, to push. No hand grasps pointing up.
    """
    positions_m, frames = motion.trajectory.positions_m, [switch.frame for switch in motion.switches]
    ways = [(frame, way_m) for frame in frames if (way_m := _approach(positions_m[: frame + 1])) is not None]
    if not ways:
        return
    quaternions = motion.trajectory.quaternions_xyzw[[frame for frame, _ in ways]]
    directions = np.array([way_m for _, way_m in ways])
    as_read, as_meant = (_off_way_deg(q, directions) for q in (quaternions, _w_first(quaternions)))
    may_be_right = _off_way_deg(quaternions, DOWN).max() < OFF_UPRIGHT_DEG
    points_up = _off_way_deg(_w_first(quaternions), UP).min() < ACROSS_DEG
    if not (may_be_right or points_up) and as_read.min() > ACROSS_DEG and as_meant.max() < ALONG_DEG:
        message = "are a hand that moves the way it points before it grasps only if w comes first"
        raise InvalidInputError("trajectory.end_effector_quaternions_xyzw", message, "order x y z w")


def _approach(positions_m: Array) -> Array | None:
    """Return (3,) the last `APPROACH_M` of a path; None if it is shorter."""
    away_m = np.linalg.norm(positions_m - positions_m[-1], axis=1)
    before = np.flatnonzero(away_m >= APPROACH_M)
    if not len(before):
        return None
    way_m: Array = positions_m[-1] - positions_m[before[-1]]
    return way_m


def _off_way_deg(quaternions_xyzw: Array, ways_m: Array) -> Array:
    """Return (N,) angles between the rotations' z axes and directions (N, 3), or one direction (3,)."""
    axes = Rotation.from_quat(quaternions_xyzw).apply([0.0, 0.0, 1.0])
    along = (axes * ways_m).sum(axis=1) / np.linalg.norm(ways_m, axis=-1)
    angles: Array = np.degrees(np.arccos(np.clip(along, -1, 1)))
    return angles


def check_objects_order(objects: Sequence[ObjectPose]) -> None:
    """Refuse objects that are all upright only if w comes first, several of them inclined at different angles.

    A single object may well lie on its side, stand on its head or be inclined about the x axis.

    Raises:
        InvalidInputError: naming the object.
    """
    turned, quaternions = _turned(objects)
    tilts_deg = _off_way_deg(quaternions, UP)
    inclined = _is_inclined(tilts_deg)
    if _upright_if_w_first(quaternions).all() and inclined.any() and np.ptp(tilts_deg[inclined]) > ONE_TILT_DEG:
        place = int(np.argmax(tilts_deg * inclined))
        message = f"is {quaternions[place].round(4).tolist()}: upright only if w comes first"
        raise InvalidInputError(f"objects[{turned[place].name}].quaternion_xyzw", message, "order x y z w")


def tilted_about_x(objects: Sequence[ObjectPose]) -> tuple[str, ...]:
    """Return the names of the objects that are tilted, and would be upright if w came first."""
    known, quaternions = _turned(objects)
    only_if = (_off_way_deg(quaternions, UP) > OFF_UPRIGHT_DEG) & _upright_if_w_first(quaternions)
    return tuple(pose.name for pose, is_tilted in zip(known, only_if, strict=True) if is_tilted)


def _turned(objects: Sequence[ObjectPose]) -> tuple[list[ObjectPose], Array]:
    known = [pose for pose in objects if pose.quaternion_xyzw is not None]
    return known, np.array([pose.quaternion_xyzw for pose in known]).reshape(-1, 4)


def objects_order_findings(demonstrations: Sequence[Demonstration]) -> Iterator[Finding]:
    """Yield a finding for an object with w first in some demonstrations, or in all.

    It is upright in each, with w first in some of them. As it is read, it would have been on its head and inclined
    besides, differently each time; lids incline less, and what is turned over is not inclined.
    """
    for name in [pose.name for pose in demonstrations[0].objects] if len(demonstrations) >= MIN_TILTS else ():
        quaternions = [item.object(name).quaternion_xyzw for item in demonstrations]
        known = np.array([quaternion for quaternion in quaternions if quaternion is not None])
        if len(known) < len(quaternions):
            continue
        tilts_deg, w_first = _off_way_deg(known, UP), _upright_if_w_first(known)
        upside_down = w_first & _is_inclined(tilts_deg) & (tilts_deg > ON_ITS_HEAD_DEG)
        share = float((w_first & (tilts_deg > OFF_UPRIGHT_DEG)).mean())
        upright = w_first | (tilts_deg < UPRIGHT_DEG)
        if upside_down.any() and upright.all() and np.ptp(tilts_deg) > OFF_UPRIGHT_DEG:
            message = (
                f"In {share:.0%} of the demonstrations {name} is upright only if its quaternion has w first. Upload"
                " these recordings again with quaternions in the order x y z w."
            )
            yield from W_FIRST_OF_OBJECT.findings(share, message, f"objects[{name}]", share=share)


def _is_inclined(tilts_deg: Array) -> npt.NDArray[np.bool_]:
    """Return (N,) bool: tilted, but neither lying on a side nor upside down."""
    inclined: npt.NDArray[np.bool_] = (tilts_deg > OFF_UPRIGHT_DEG) & (
        np.abs((tilts_deg + 45) % 90 - 45) > ONE_TILT_DEG
    )
    return inclined


def _upright_if_w_first(quaternions: Array) -> npt.NDArray[np.bool_]:
    upright: npt.NDArray[np.bool_] = _off_way_deg(_w_first(quaternions), UP) < UPRIGHT_DEG
    return upright


def _w_first(quaternions: Array) -> Array:
    return np.roll(quaternions, -1, axis=1)
