"""Each demonstration's row, predicted from the others' rows."""

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.arrays import Array
from app.pipeline.check.report import Off
from app.pipeline.episode import EndEffectorAction
from app.pipeline.plans import PlanRow
from app.pipeline.plans.rows import robust_centre


def left_out(row: PlanRow) -> list[Off]:
    """How far each of at least two demonstrations is from where the others predict it.

    The others' centre is placed in the demonstration's own scene: distances and angles are the same there as seen from
    what the row follows.
    """
    number = len(row.offsets_m)
    return [_from_others(row, np.arange(number) != place, place) for place in range(number)]


def _from_others(row: PlanRow, others: np.ndarray, place: int) -> Off:
    centre_m, mean = robust_centre(row.offsets_m[others], row.rotations[others])
    return _off(row.offsets_m[place] - centre_m, mean.inv() * row.rotations[place])


def _off(way_m: Array, turn: Rotation) -> Off:
    return Off(float(np.linalg.norm(way_m)), float(np.degrees(turn.magnitude())))


def median_off(offs: list[Off]) -> Off:
    """The middle distance and the middle angle."""
    return Off(float(np.median([off.m for off in offs])), float(np.median([off.deg for off in offs])))


def variation(actions: list[EndEffectorAction]) -> Off:
    """How far the median action is from the actions' centre in the world."""
    positions_m = np.array([action.position_m for action in actions])
    rotations = Rotation.from_quat([action.quaternion_xyzw for action in actions])
    centre_m, mean = robust_centre(positions_m, rotations)
    return median_off([_off(m, turn) for m, turn in zip(positions_m - centre_m, mean.inv() * rotations, strict=True)])


def off_between(predicted: EndEffectorAction, shown: EndEffectorAction) -> Off:
    """How far a predicted action is from the demonstrated one."""
    turn = Rotation.from_quat(shown.quaternion_xyzw).inv() * Rotation.from_quat(predicted.quaternion_xyzw)
    return _off(predicted.position_m - shown.position_m, turn)
