"""How hands turn with objects: it tells a hand in another frame, or quaternions with w first, from right ones.

Both may be alike in all recordings, so that nothing scatters where the hand acts.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.findings import Finding
from app.pipeline.findings.rules import BESIDE, W_FIRST
from app.pipeline.order.order import Order
from app.pipeline.plans.rows import PlanRow, acting_rows
from app.pipeline.plans.support import Support, asked_anchor
from roboprompt_client.arrays import Array

MIN_DEMONSTRATIONS = 5
TURNS_DEG = 8.0  # what turns by less has hardly been turned
MUCH_LESS = 1 / 3


class Turning(NamedTuple):
    """A row in which the hand acts on an object whose rotations are known.

    Attributes:
        name: of the object, as it is asked for.
        hands_xyzw, objects_xyzw: (N, 4) in the demonstrations.
    """

    row: PlanRow
    name: str
    hands_xyzw: Array
    objects_xyzw: Array

    def beside_m(self) -> float:
        """How far beside the object the hand acts, where it turns with the object and its place does not; else 0."""
        with_object_deg, with_world_deg = self._scatters_deg(self.hands_xyzw)
        turns_with_it = with_world_deg > TURNS_DEG and with_object_deg < MUCH_LESS * with_world_deg
        is_beside = turns_with_it and not self.row.anchors[0].place_turns
        return float(np.linalg.norm(self.row.centre_m[:2])) if is_beside else 0.0

    def astray_deg(self) -> float:
        """How far the hand scatters about object and world, where it would about neither if w came first; else 0."""
        as_read_deg = min(self._scatters_deg(self.hands_xyzw))
        as_meant_deg = min(self._scatters_deg(np.roll(self.hands_xyzw, -1, axis=1)))
        return as_read_deg if as_meant_deg < MUCH_LESS * as_read_deg else 0.0

    def _scatters_deg(self, hands_xyzw: Array) -> tuple[float, float]:
        """How far rotations of the hand scatter, seen from the object and seen from the world."""
        hands, objects = Rotation.from_quat(hands_xyzw), Rotation.from_quat(self.objects_xyzw)
        return _scatter_deg(objects.inv() * hands), _scatter_deg(hands)


def turning_findings(support: Support, asked: Order) -> Iterator[Finding]:
    """At most one doubt of each kind about the rows in which the hand acts on an object."""
    turning = list(_turning(support, asked))
    if not turning:
        return
    item = max(turning, key=Turning.beside_m)
    if BESIDE.severity(far_m := item.beside_m()) is not None:
        message = (
            f"The hand turns with {item.name}, but acts {100 * far_m:.0f} cm beside it, on one side as the world has"
            " it, however it is turned: are hand and objects in one frame?"
        )
        yield BESIDE.finding(message, f"objects[{item.name}]", {"beside_m": far_m}, value=far_m)
    item = max(turning, key=Turning.astray_deg)
    if W_FIRST.severity(off_deg := item.astray_deg()) is not None:
        message = (
            f"Where the hand acts, it is turned by {off_deg:.0f} degrees this way and that; with w first in its"
            f" quaternions it would turn as {item.name} does. They must be x y z w."
        )
        yield W_FIRST.finding(message, "demonstrations", {"off_deg": off_deg}, value=off_deg)


def _turning(support: Support, asked: Order) -> Iterator[Turning]:
    for group, rows in support.alike(asked):
        for k in acting_rows(rows) if len(group) >= MIN_DEMONSTRATIONS else ():
            names = [anchor.object_name for anchor in rows[k].anchors]
            if not all(names):
                continue
            turned = [d.object(name).quaternion_xyzw for d, name in zip(group, names, strict=True)]
            objects_xyzw = [turn for turn in turned if turn is not None]
            if len(objects_xyzw) == len(group):
                hands_xyzw = np.array([demonstration.actions[k].quaternion_xyzw for demonstration in group])
                name = asked_anchor(rows[k].anchors[0], group[0].order, asked).object_name
                yield Turning(rows[k], name, hands_xyzw, np.array(objects_xyzw))


def _scatter_deg(rotations: Rotation) -> float:
    """How far the median rotation is from their mean."""
    return float(np.degrees(np.median((rotations.mean().inv() * rotations).magnitude())))
