"""One demonstration that does a thing in a way of its own: where the gripper acts, its hand is turned otherwise.

Such a demonstration does not scatter, and it is no part of the others' plan: what is between the two serves neither.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.plans.rows import PlanRow, plan_rows
from app.pipeline.representation.anchors import relative_action, tilted_objects

FEWEST = 4  # demonstrations: two that agree against one may do so by chance
TURNED_DEG = 60.0  # from all others
ALIKE_DEG = 20.0  # the others are turned alike


def lone_way(group: Sequence[Demonstration]) -> int | None:
    """The place of a demonstration whose hand is turned otherwise than all others' where the gripper acts.

    Args:
        group: demonstrations of one plan, with equally many actions.
    """
    if len(group) < FEWEST or not group[0].actions:
        return None
    states = [[action.gripper_open for action in demonstration.actions] for demonstration in group]
    acting = [k for k in range(1, len(states[0])) if any(shown[k] != shown[k - 1] for shown in states)]
    candidates = {place for k in acting if (place := _odd(group, k)) is not None}
    return next((place for place in sorted(candidates) if _is_alone(group, place, acting)), None)


def _odd(group: Sequence[Demonstration], k: int) -> int | None:
    """Whose hand is turned farthest from the others' in the world, if it is so from each of them."""
    hands = Rotation.from_quat([demonstration.actions[k].quaternion_xyzw for demonstration in group])
    apart_deg = np.degrees([(hand.inv() * hands).magnitude() for hand in hands])
    np.fill_diagonal(apart_deg, np.inf)
    place = int(apart_deg.min(axis=1).argmax())
    return place if apart_deg[place].min() > TURNED_DEG else None


def _is_alone(group: Sequence[Demonstration], place: int, acting: Sequence[int]) -> bool:
    others = [demonstration for k, demonstration in enumerate(group) if k != place]
    rows, tilted = plan_rows(others), tilted_objects(group)
    return any(
        float(rows[k].off_deg.max()) <= ALIKE_DEG and _turned_deg(group[place], k, rows[k], tilted) > TURNED_DEG
        for k in acting
    )


def _turned_deg(demonstration: Demonstration, k: int, row: PlanRow, tilted: frozenset[str]) -> float:
    """How far its hand is turned from where the others have it."""
    _, hand = relative_action(demonstration, k, row.anchors[0], tilted)
    return float(np.degrees((row.mean_rotation.inv() * hand).magnitude()))
