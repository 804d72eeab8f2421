"""Symmetries that demonstrations show: hands take whichever of an object's equal sides is nearest to them.

A cube lies at any yaw, and hands turn by 45 degrees at most: seen from the cube, grasps lie quarter turns apart. They
are equal once each cube is folded, i.e. turned by as many quarters. That is done only if nothing else in the
demonstrations depends on the side: a mug whose handle ends at a hook is no cube, even if hands take its body by the
nearest side.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration, rotation_of
from app.pipeline.geometry import canonical_pose
from app.pipeline.groups import grouped
from app.pipeline.plans.alignment import aligned
from app.pipeline.plans.recording import Recording, touched
from app.pipeline.plans.rows import PlanRow, plan_rows
from app.pipeline.representation.anchors import tilted_objects
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.quaternions import yaw_rad

TURNS_DEG = (180.0, 90.0)  # the coarser first, because it implies the finer
MIN_GRASPS = 5
ALIKE_DEG = 15.0  # five grasps from one side differ from their mean by less
LOOSELY_ALIKE_DEG = 20.0  # so may those of any number: people align their hands no better
MIN_SIDES = 3  # of four; two may be those of two models of one object
MIN_OF_TWO = 2  # grasps from each of two sides; one may be a slip
NOISE_DEG = 5.0  # hands that take the nearest side turn by no more than the sides are apart, and this
SLIPS_SHARE = 0.1  # of the demonstrations, which may do something else by chance
MATTERS = 1 / 3  # as small a share of the scatter is left, once the side is known
SCATTERS_M, SCATTERS_DEG = 0.01, 10.0  # rms; less needs no explanation


class Symmetry(NamedTuple):
    """A turn about the vertical after which an object is taken alike.

    Attributes:
        toward_rad: the yaw to which folded objects are near.
        grasp: the mean rotation of hands that take it, seen from the folded object.
    """

    turn_deg: float
    toward_rad: float
    grasp: Rotation

    def folded(self, pose: ObjectPose, hand: Rotation | None = None) -> ObjectPose:
        """Return the pose with the object turned to the side that the hand took; None: that it would take."""
        toward_rad = self.toward_rad if hand is None else yaw_rad((hand * self.grasp.inv()).as_quat())
        return canonical_pose(pose, self.turn_deg, toward_rad)


Symmetries = Mapping[str, Symmetry]
"""By name of the object."""


def shown_symmetries(recordings: Sequence[Recording], declared: Mapping[str, float]) -> Symmetries:
    """Return the symmetries that demonstrations prove.

    Args:
        recordings: of one task, with symmetric objects at their canonical yaw.
        declared: the objects of which the task's settings say whether they are symmetric.
    """
    found: dict[str, Symmetry] = {}
    if not recordings or not recordings[0].rule.aligned:
        return found
    tilted = tilted_objects([recording.demonstration for recording in recordings])
    groups = list(grouped(recordings, lambda each: each.demonstration.order.form).values())
    for name in sorted({name for each in recordings for name in touched(each)} - tilted - declared.keys()):
        taking = [group for group in groups if any(name in touched(each) for each in group)]
        symmetry = _symmetry_of(name, [each for group in taking for each in group])
        more = {**found, name: symmetry} if symmetry else found
        if symmetry and not any(_side_matters(name, folded(group, more), group) for group in taking):
            found[name] = symmetry
    return found


def folded(recordings: Sequence[Recording], symmetries: Symmetries) -> list[Recording]:
    """Return the recordings with each symmetric object turned to the side that the hand takes."""
    if not symmetries:
        return list(recordings)
    return [replace(each, demonstration=_folded(each, symmetries)) for each in recordings]


def _folded(recording: Recording, symmetries: Symmetries) -> Demonstration:
    hands = {name: touch.hand for name, touch in touched(recording).items()}
    poses = tuple(
        symmetries[pose.name].folded(pose, hands.get(pose.name)) if pose.name in symmetries else pose
        for pose in recording.demonstration.objects
    )
    return replace(recording.demonstration, objects=poses)


def sides_of(turns_deg: Array, turn_deg: float) -> tuple[Array, npt.NDArray[np.intp]]:
    """Return how far turns (N,) are from whole multiples of a turn apart (N,), and how many multiples (N,) they are."""
    phases = np.exp(2j * math.pi * turns_deg / turn_deg)
    left_deg = np.angle(phases / phases.mean()) * turn_deg / (2 * math.pi)  # from the circular mean
    whole = np.round((turns_deg - left_deg - (turns_deg - left_deg)[0]) / turn_deg).astype(int)
    return left_deg, whole % round(360 / turn_deg)


def _symmetry_of(name: str, recordings: Sequence[Recording]) -> Symmetry | None:
    """Return the symmetry under which all grasps of an object are equal, and hands take the nearest side."""
    touches = [touched(each).get(name) for each in recordings]
    objects = [each.demonstration.object(name).quaternion_xyzw for each in recordings]
    known = [(touch, q) for touch, q in zip(touches, objects, strict=True) if touch is not None and q is not None]
    if len(known) < max(MIN_GRASPS, (1 - SLIPS_SHARE) * len(recordings)):
        return None
    hands = Rotation.concatenate([touch.hand for touch, _ in known])
    taking = [touch.taking for touch, _ in known if touch.taking is not None]
    hands_deg = _turned_deg(hands)
    turns_deg = _turned_deg(hands * Rotation.concatenate(taking).inv()) if len(taking) == len(known) else hands_deg
    if np.linalg.norm(hands_deg[:, :2], axis=1).max() > ALIKE_DEG:
        return None
    yaws_deg = np.degrees([yaw_rad(quaternion) for _, quaternion in known])
    for turn_deg in TURNS_DEG:
        left_deg, sides = sides_of(hands_deg[:, 2] - yaws_deg, turn_deg)
        alike = np.abs(left_deg).max() <= _alike_deg(len(known), turn_deg)
        if alike and _nearest_taken(turns_deg[:, 2], sides, turn_deg):
            return _symmetry(hands, yaws_deg + turn_deg * sides, turn_deg)
    return None


def _turned_deg(rotations: Rotation) -> Array:
    """Return rotation vectors (N, 3) from the first one, in degrees, along the world's axes."""
    turned_deg: Array = (rotations * rotations[0].inv()).as_rotvec(degrees=True)
    return turned_deg


def _alike_deg(number: int, turn_deg: float) -> float:
    """Return how far grasps may be from their mean, so that chance passes no more often than with `MIN_GRASPS`.

    N random directions all lie within such a share of the circle with probability N share^(N-1).
    """
    least = 2 * ALIKE_DEG / turn_deg
    share: float = (MIN_GRASPS * least ** (MIN_GRASPS - 1) / number) ** (1 / (number - 1))
    return min(share * turn_deg / 2, LOOSELY_ALIKE_DEG)


def _nearest_taken(turns_deg: Array, sides: npt.NDArray[np.intp], turn_deg: float) -> bool:
    """Return whether hands take enough of the sides, and turn about the vertical no farther than need be for that.

    Two sides may be those of two models of an object that always lies alike: hands then hardly turn.
    """
    numbers = np.bincount(sides)
    sorted_deg = np.sort(turns_deg % 360)
    span_deg = 360 - np.diff(sorted_deg, append=sorted_deg[0] + 360).max()
    if span_deg > turn_deg + NOISE_DEG:
        return False
    if turn_deg == 180:
        return bool(numbers.size == 2 and numbers.min() >= MIN_OF_TWO and span_deg > turn_deg / 2)
    return bool(np.count_nonzero(numbers) >= MIN_SIDES)


def _symmetry(hands: Rotation, folded_deg: Array, turn_deg: float) -> Symmetry:
    """Return the symmetry with yaws as near to 0 as whole turns allow.

    Args:
        folded_deg: (N,) the yaws of the folded objects, alike but for one number of whole turns.
    """
    toward_deg = math.degrees(np.angle(np.exp(1j * np.radians(folded_deg)).mean()))
    less_deg = turn_deg * round(toward_deg / turn_deg)
    objects = Rotation.from_euler("z", (folded_deg - less_deg)[:, None], degrees=True)
    return Symmetry(turn_deg, math.radians(toward_deg - less_deg), (objects.inv() * hands).mean())


def _side_matters(name: str, group: Sequence[Recording], given: Sequence[Recording]) -> bool:
    """Return whether something in the demonstrations of one instruction depends on the side that was taken.

    Args:
        group, given: with the object folded, and as it was.
    """
    of_kinds = grouped(zip(aligned(group), group, given, strict=True), lambda each: each[0].kind)
    usual = max(of_kinds.values(), key=len)
    if len(group) - len(usual) > SLIPS_SHARE * len(group):
        return True  # the side may decide between the ways
    demonstrations = [demonstration for demonstration, _, _ in usual]
    turned_deg = [_yaw_deg(one, name) - _yaw_deg(other, name) for _, one, other in usual]
    _, sides = sides_of(np.array(turned_deg), 90.0)
    return any(
        _explained(values, sides, least)
        for row in plan_rows(demonstrations)
        for values, least in _seen(row, demonstrations)
    )


def _yaw_deg(recording: Recording, name: str) -> float:
    return math.degrees(yaw_rad(rotation_of(recording.demonstration.object(name))))


def _seen(row: PlanRow, demonstrations: Sequence[Demonstration]) -> Iterator[tuple[Array, float]]:
    """Yield offsets and rotation vectors (N, 3) of the hand in a row, seen from the world and from each object."""
    yield row.offsets_m, SCATTERS_M
    yield row.positions_m, SCATTERS_M
    yield _turns(row.hands), math.radians(SCATTERS_DEG)
    for place in range(len(demonstrations[0].ordered_objects)):
        poses = [item.ordered_objects[place] for item in demonstrations]
        turned = [pose.quaternion_xyzw for pose in poses if pose.quaternion_xyzw is not None]
        if len(turned) == len(poses):
            axes = Rotation.from_quat(turned).inv()
            yield axes.apply(row.positions_m - [pose.position_m for pose in poses]), SCATTERS_M
            yield _turns(axes * row.hands), math.radians(SCATTERS_DEG)


def _turns(hands: Rotation) -> Array:
    turns: Array = (hands[0].inv() * hands).as_matrix().reshape(len(hands), 9) / math.sqrt(2)
    return turns


def _explained(values: Array, sides: npt.NDArray[np.intp], least: float) -> bool:
    """Return whether values (N, D) scatter, and hardly among those of one side: an analysis of variance."""
    number, groups = len(values), [values[sides == side] for side in np.unique(sides)]
    within = sum(float(((each - each.mean(axis=0)) ** 2).sum()) for each in groups)
    total = float(((values - values.mean(axis=0)) ** 2).sum())
    left = math.sqrt(within / max(number - len(groups), 1)), math.sqrt(total / (number - 1))
    return left[1] > least and left[0] < MATTERS * left[1]
