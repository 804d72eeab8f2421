"""Objects that the hand grasps from several sides: turned by a quarter or a half they are the same to it."""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.findings import Finding
from app.pipeline.plans import Recording
from app.pipeline.representation.anchors import object_rotation, tilted_objects
from roboprompt_client.arrays import Array

SYMMETRIES_DEG = (180.0, 90.0)  # the coarser first: what is alike by it is alike by the finer, too
ALIKE_DEG = 15.0  # from their mean: grasps from one side differ by less
MIN_OF_OTHER_SIDES = 2


def symmetry_findings(recordings: Sequence[Recording]) -> Iterator[Finding]:
    """For each object whose grasps lie a quarter or a half turn apart, the setting that makes them one."""
    tilted = tilted_objects([recording.demonstration for recording in recordings])
    grasps: dict[str, list[Rotation]] = defaultdict(list)
    for recording in recordings:
        for name, hand in _grasps(recording):
            pose = recording.demonstration.object(name)
            if pose.quaternion_xyzw is not None and name not in tilted:
                grasps[name].append(object_rotation(pose, "o", tilted).inv() * hand)
    for name, hands in grasps.items():
        found = (_of_symmetry(name, _turns_deg(Rotation.concatenate(hands)), each) for each in SYMMETRIES_DEG)
        yield from [finding for finding in found if finding is not None][:1]


def _of_symmetry(name: str, turns_deg: Array, symmetry_deg: float) -> Finding | None:
    """The suggestion, if grasps from several sides are one by this symmetry."""
    left_deg = _off_mean_deg(turns_deg, symmetry_deg)
    whole = np.round((turns_deg - left_deg - (turns_deg - left_deg)[0]) / symmetry_deg)
    sides = np.bincount((whole % round(360 / symmetry_deg)).astype(int))
    # a side that one demonstration takes may be a slip
    if np.abs(left_deg).max() > ALIKE_DEG or len(turns_deg) - sides.max() < MIN_OF_OTHER_SIDES:
        return None
    return _finding(name, symmetry_deg, len(turns_deg), float(np.abs(left_deg).max()))


def _grasps(recording: Recording) -> Iterator[tuple[str, Rotation]]:
    """The objects that are clearly grasped, each with the hand's rotation there."""
    objects = recording.demonstration.ordered_objects
    closing = [phase.last for phase in recording.motion.phases if phase.gripper_open and not phase.ends_open]
    for place, frame in zip(recording.grasped, closing, strict=False):
        if place is not None:
            hand = Rotation.from_quat(recording.motion.trajectory.quaternions_xyzw[frame])
            yield objects[place].name, hand


def _turns_deg(hands: Rotation) -> Array:
    """(N,) how far each of those that are not tilted from the first is turned from it about the vertical."""
    turns: Array = (hands * hands[0].inv()).as_rotvec(degrees=True)
    about: Array = turns[np.linalg.norm(turns[:, :2], axis=1) <= ALIKE_DEG, 2]
    return about


def _off_mean_deg(turns_deg: Array, period_deg: float) -> Array:
    """(N,) the turns from their circular mean, modulo a period, as near to 0 as they come."""
    phases = np.exp(2j * math.pi * turns_deg / period_deg)
    off: Array = np.angle(phases / phases.mean()) * period_deg / (2 * math.pi)
    return off


def _finding(name: str, symmetry_deg: float, number: int, left_deg: float) -> Finding:
    message = (
        f"The {number} grasps of {name} are from several sides, within {left_deg:.0f} degrees of turns by"
        f" {symmetry_deg:g} degrees. If {name} looks the same turned so, set the task's yaw_symmetry_deg to"
        f' {{"{name}": {symmetry_deg:g}}}: the grasps are then one way.'
    )
    numbers = {"symmetry_deg": symmetry_deg, "grasps": number, "left_deg": round(left_deg, 1)}
    return Finding("object-may-be-symmetric", "info", message, f"yaw_symmetry_deg[{name}]", numbers)
