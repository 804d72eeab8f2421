"""Agreement of demonstrations: rows that scatter around one value are replaced by their robust mean.

Rows that depend on something else in the scene, or are done in several ways, stay as recorded: two ways are never
averaged.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.plans.acting import acting_rows
from app.pipeline.plans.rows import PlanRow, left_out_m, plan_rows
from app.pipeline.plans.ways import GAP, two_ways
from app.pipeline.representation.anchors import NOT_TURNED, anchor_poses
from app.pipeline.thresholds import BEYOND_NOISE_M, M_PER_RAD
from roboprompt_client.types.poses import EndEffectorAction

EXPLAINED = 0.5  # of the residual: where the scene leaves less of it, the row depends on the scene
NEGLIGIBLE_M = 0.02  # scatter that needs no explanation
FAR_APART_M = 0.03  # two demonstrations that differ by more may be two ways


def agreed(group: Sequence[Demonstration]) -> tuple[Demonstration, ...]:
    """Return the demonstrations of one plan, with the robust mean in each row that they agree on.

    Rows that act in different places stay as recorded: the hand would do nothing useful half-way between.

    Args:
        group: with equally many actions and the same form of instruction.
    """
    if len(group) == 1 or not group[0].actions:
        return tuple(group)
    columns, rows = [], plan_rows(group)
    undecided = {k for k, row in enumerate(rows) if row.way_off_m > BEYOND_NOISE_M}
    if undecided.isdisjoint(acting_rows(rows)):
        undecided = set()
    for k, row in enumerate(rows):
        shown = [demonstration.actions[k] for demonstration in group]
        columns.append(_at_center(group, row) if k not in undecided and agrees(group, row) else shown)
    return tuple(
        replace(demonstration, actions=tuple(actions))
        for demonstration, actions in zip(group, zip(*columns, strict=True), strict=True)
    )


def _at_center(group: Sequence[Demonstration], row: PlanRow) -> list[EndEffectorAction]:
    positions_m, hands = anchor_poses(row.anchors, group).placed(row.center_m, row.mean_rotation)
    return EndEffectorAction.many(positions_m, hands.as_quat(canonical=True), [row.gripper_open] * len(group))


def agrees(group: Sequence[Demonstration], row: PlanRow) -> bool:
    """Return whether the row scatters around one value."""
    if len(group) == 2:
        off_m = float(np.linalg.norm(row.offsets_m[0] - row.offsets_m[1]))
        turn_m = M_PER_RAD * float((row.rotations[0].inv() * row.rotations[1]).magnitude())
        return off_m + turn_m <= FAR_APART_M
    return two_ways(row, GAP) is None and not _depends_on_scene(group, row)


def _depends_on_scene(group: Sequence[Demonstration], row: PlanRow) -> bool:
    """Return whether a row's offset depends on where other objects are, e.g. half-way between two of them.

    Then a linear regression on an object's place halves the leave-one-out error.
    """
    if row.scatter_m < NEGLIGIBLE_M or len(group) < 6:
        return False
    constant_m = left_out_m(np.zeros((len(group), 0)), row.offsets_m)
    poses = anchor_poses(row.anchors, group)
    for place in range(len(group[0].objects)):
        places_m = np.array([demonstration.ordered_objects[place].position_m for demonstration in group])
        seen_m, _ = poses.seen(places_m, NOT_TURNED)
        if seen_m.std(axis=0).max() > NEGLIGIBLE_M and left_out_m(seen_m, row.offsets_m) < EXPLAINED * constant_m:
            return True
    return False
