"""What explains the scatter of demonstrations where the hand acts, so that it is no noise."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.plans.agreement import left_out_errors_m
from app.pipeline.plans.rows import PlanRow
from roboprompt_client.types.poses import ObjectPose

SCATTER_M = 0.01  # the least scatter of people and pose estimators
EXPLAINED_M = 0.007  # the least scatter that is worth an explanation
LEFT = 0.2  # the share of the scatter (leave one out) that is left where something explains it: then it is no noise
FEWEST_EXPLAINED = 5  # demonstrations
FREEDOM = 6  # degrees of freedom (demonstrations less fitted numbers) below which proportionally less may be left
VARIES_M = 0.005  # what varies by less explains nothing


def explained_m(shown: Sequence[Demonstration], row: PlanRow, *, by_objects: bool) -> tuple[float, str]:
    """Return how far demonstrations are from the center of a row, and what explains it; (0, "") if nothing does.

    A camera that drifts explains it by the order of the recordings, another tool by where the hand starts (both are
    measured at another point of it), a wrong scale or a turned frame by where the object stands, and a place that
    depends on two objects by where the other one stands, seen from the first.

    Args:
        by_objects: whether the hand itself acts, and not on the way, which may depend on anything.
    """
    if len(shown) < FEWEST_EXPLAINED or row.scatter_m < EXPLAINED_M or not row.anchors[0].object_name:
        return 0.0, ""
    places_m = np.array([d.object(a.object_name).position_m for d, a in zip(shown, row.anchors, strict=True)])
    starts_m = [d.start.position_m for d in shown if d.start is not None]
    causes = {
        "the order of the recordings": np.linspace(0, 1, len(shown))[:, None],
        "where the hand starts": np.array(starts_m if len(starts_m) == len(shown) else np.zeros((len(shown), 3))),
        f"the place of {row.anchors[0].object_name}": places_m,
    }
    for poses in _others(shown, row) if by_objects else ():
        causes.setdefault(f"the place of {poses[0].name}", np.array([pose.position_m for pose in poses]) - places_m)
    for name, inputs in causes.items():
        varied = inputs[:, inputs.std(axis=0) > VARIES_M]
        for seen_m in (row.positions_m - places_m, row.offsets_m):  # along the world's axes, and the row's own
            left = float((left_out_errors_m(varied, seen_m) ** 2).sum() / (row.off_m**2).sum())
            freedom = len(shown) - varied.shape[1] - 1
            if varied.shape[1] and left < LEFT * min(1, freedom / FREEDOM):
                return float(row.off_m.max()), name
    return 0.0, ""


def _others(shown: Sequence[Demonstration], row: PlanRow) -> Iterator[tuple[ObjectPose, ...]]:
    """Yield the poses of each object that the row does not follow; its name may differ between demonstrations."""
    for poses in zip(*(item.ordered_objects for item in shown), strict=False):
        if all(pose.name != anchor.object_name for pose, anchor in zip(poses, row.anchors, strict=True)):
            yield poses


def unlike_most_m(shown: Sequence[Demonstration], row: PlanRow) -> float:
    """Return the scatter of a row if most hands are at one place relative to an object that it does not follow."""
    for poses in _others(shown, row):
        away_m = row.positions_m - [pose.position_m for pose in poses]
        turns = Rotation.from_quat(
            [(0, 0, 0, 1) if pose.quaternion_xyzw is None else pose.quaternion_xyzw for pose in poses]
        )
        for seen_m in (away_m, turns.inv().apply(away_m)):
            if np.median(np.linalg.norm(seen_m - np.median(seen_m, axis=0), axis=1)) < SCATTER_M:
                return row.scatter_m
    return 0.0
