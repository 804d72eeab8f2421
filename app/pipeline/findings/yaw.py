"""Hands that turn with an object: beside it, or only if rotations meant something else than they say."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.findings import Finding, rules
from app.pipeline.findings.places import MIN_TURNED, MUCH_LESS
from app.pipeline.findings.quaternion_order import MISREADINGS, likeliest_meaning, off_mean_deg
from app.pipeline.geometry import least_apart_rad
from app.pipeline.order.order import Order
from app.pipeline.plans.acting import touching_rows
from app.pipeline.plans.rows import PlanRow, of_a_way
from app.pipeline.plans.support import Support
from app.pipeline.representation.anchors import asked_anchor
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.severity import SEVERITIES

BESIDE_M = 0.05  # from an object: what is put down there is not put into it
TURNS_DEG = 8.0  # what turns by less has hardly been turned

Rotations = Mapping[str, Mapping[str, Array]]
"""(4,) by id of the demonstration and name of the object."""


def _turned(factor: float) -> Callable[[Rotation, Rotation], Rotation]:
    return lambda objects, hands: Rotation.from_rotvec(factor * objects.as_rotvec()).inv() * hands


def _nearest_turn(step_deg: float) -> Callable[[Rotation, Rotation], Rotation]:
    """Return the hands seen from objects, each turned by the multiple of a step by which it is nearest to the first."""
    turns = Rotation.from_euler("z", np.arange(0.0, 360.0, step_deg)[:, None], degrees=True)

    def read(objects: Rotation, hands: Rotation) -> Rotation:
        seen = objects.inv() * hands
        turned = [turn * seen for turn in turns]
        nearest = np.argmin([(seen[0].inv() * each).magnitude() for each in turned], axis=0)
        return Rotation.concatenate([turned[int(which)][k] for k, which in enumerate(nearest)])

    return read


def _either_way(objects: Rotation, hands: Rotation) -> Rotation:
    """Return the hands seen from objects, each turned as it says or the other way: by that in which most are alike."""
    seen = Rotation.concatenate([objects.inv() * hands, objects * hands])
    apart_rad = quaternions.angles_rad(seen.as_quat()[:, None], seen.as_quat()).reshape(-1, 2, len(hands))
    like = apart_rad[apart_rad.min(axis=1).sum(axis=1).argmin()]
    return seen[like.argmin(axis=0) * len(hands) + np.arange(len(hands))]


# What rotations of an object may mean instead of what they say; hands are then turned alike, seen from it
READINGS: Mapping[str, Callable[[Rotation, Rotation], Rotation]] = {
    "were turned the other way": _turned(-1.0),
    "were turned the other way in some": _either_way,
    "were turned twice as far": _turned(2.0),
    "were turned half as far": _turned(0.5),
    "were turned by half a turn more in some": _nearest_turn(180.0),
}
# The same of an object with a declared symmetry, by the greater symmetries that it may have instead
READINGS_OF_SYMMETRIC: Mapping[float, tuple[str, Callable[[Rotation, Rotation], Rotation]]] = {
    360.0: ("had no symmetry (yaw_symmetry_deg)", _turned(1.0)),
    180.0: ("had a yaw_symmetry_deg of 180", _nearest_turn(180.0)),
    90.0: ("had a yaw_symmetry_deg of 90", _nearest_turn(90.0)),
}


@dataclass(frozen=True, eq=False)
class TurningRow:
    """A row in which the hand acts on an object whose rotations are known.

    Attributes:
        name: of the object, as it is asked for.
        objects: its N rotations in the demonstrations.
        symmetry_deg: declared for it; None where none is.
        given: its rotations before that was applied; None where none is.
        aside_m: (2,) the horizontal offset of the hand from the object along the world's axes.
        taken_aside_m: the same where the hand took what it lets go of here; None where it lets go of nothing.
        takes: whether the hand closes here.
    """

    row: PlanRow
    name: str
    objects: Rotation
    symmetry_deg: float | None
    given: Rotation | None
    aside_m: Array
    taken_aside_m: Array | None
    takes: bool

    @property
    def puts_down_beside(self) -> bool:
        """Whether the hand lets go of something beside the object, whose sides then need not be those of the object."""
        return self.row.gripper_open and float(np.linalg.norm(self.aside_m)) > BESIDE_M

    def beside(self) -> tuple[Finding, ...]:
        """Return a finding if the hand acts beside the object and turns with it, but its place does not.

        What is let go of may belong there. In another frame the hand would have taken it as far beside.
        """
        with_object_deg, with_world_deg = self._scatters_deg(self.row.hands)
        turns_with_it = with_world_deg > TURNS_DEG and with_object_deg < MUCH_LESS * with_world_deg
        far_m = float(np.linalg.norm(self.row.center_m[:2]))
        if not turns_with_it or self.row.anchors[0].place_turns or self.row.anchors[0].along:
            return ()
        if self.taken_aside_m is not None and np.linalg.norm(self.taken_aside_m - self.aside_m) >= far_m / 2:
            return ()
        message = (
            f"The hand turns with {self.name}, but acts {100 * far_m:.0f} cm beside it, on one side as the world has"
            " it, however it is turned. Give hand and objects in one frame."
        )
        return rules.BESIDE_THE_OBJECT.findings(far_m, message, f"objects[{self.name}]", beside_m=far_m)

    def by_other_quaternions(self) -> tuple[Finding, ...]:
        """Return a finding if the hand scatters about object and world, and hardly would with other quaternions.

        A declared symmetry folds the object's rotations, which a mirrored hand cannot be compared with.
        """
        readings = MISREADINGS if self.given is None else MISREADINGS[:1]
        off_deg, hands_xyzw = min(self._scatters_deg(self.row.hands)), self.row.hands.as_quat()
        likely, meant_deg = likeliest_meaning(hands_xyzw, lambda hands: min(self._scatters_deg(hands)), readings)
        if meant_deg >= MUCH_LESS * off_deg:
            return ()
        message = (
            f"Where the hand acts, its rotations scatter by {off_deg:.0f} degrees; it would turn as {self.name} does if"
            f" its quaternions were {likely}. Send the hand's rotations in the world frame, order x y z w."
        )
        return rules.W_FIRST.findings(off_deg, message, "demonstrations", off_deg=off_deg)

    def by_other_yaw(self) -> tuple[Finding, ...]:
        """Return a finding if a third of the hands are turned otherwise, and are not by another reading of yaws."""
        off_deg, objects = of_a_way(self.row.off_deg), self.objects
        readings = [(text, read, math.inf) for text, read in READINGS.items()]
        greater = [
            (text, read, math.inf if deg == 360.0 else TURNS_DEG)  # any hand is within 45 degrees of a quarter turn
            for deg, (text, read) in READINGS_OF_SYMMETRIC.items()
            if deg > (self.symmetry_deg or 0.0)
        ]
        if self.given is not None and greater:
            readings, objects = [] if self.puts_down_beside else greater, self.given
        meant_deg = {text: of_a_way(off_mean_deg(read(objects, self.row.hands))) for text, read, _ in readings}
        fitting = [text for text, _, most_deg in readings if meant_deg[text] < min(most_deg, MUCH_LESS * off_deg)]
        if not fitting:
            return ()
        reading = min(fitting, key=meant_deg.__getitem__)
        message = (
            f"Where the hand acts, more than a third are turned by {off_deg:.0f} degrees or more from the others; all"
            f" would turn with {self.name} if it {reading}. Check the sign and unit of yaws, and yaw_symmetry_deg."
        )
        return rules.YAW_MISREAD.findings(off_deg, message, f"objects[{self.name}]", off_deg=off_deg)

    def scattered(self) -> tuple[Finding, ...]:
        """Return a finding if hands do not take an object alike, by turns that leave it unchanged."""
        off_deg = self._unlike_deg() if self.takes and self.symmetry_deg != 0 else 0.0
        turns = _scatter_deg(self.objects) > TURNS_DEG
        rule = rules.SCATTER_OF_HANDS if turns else rules.SCATTER_OF_HANDS_AT_UNTURNED
        message = (
            f"Where the hand takes {self.name}, more than a third are turned by {off_deg:.0f} degrees or more from the"
            f" others, relative to {self.name} and in the world. Check its rotations; if it looks the same from several"
            " sides, declare that (yaw_symmetry_deg; 0 for a round one)."
        )
        return rule.findings(off_deg, message, f"objects[{self.name}]", off_deg=off_deg)

    def _unlike_deg(self) -> float:
        """Return the angle by which more than a third of the hands are turned from the others, however seen.

        By turns that leave the object unchanged: seen from it, hands are compared with the one that most are like.
        """
        off_deg = of_a_way(self.row.off_deg)
        if self.symmetry_deg is None:
            return off_deg
        seen = self.objects.inv() * self.row.hands
        return min(off_deg, *map(of_a_way, np.degrees(least_apart_rad(seen, seen, self.symmetry_deg))))

    def _scatters_deg(self, hands: Rotation) -> tuple[float, float]:
        """Return how far rotations of the hand scatter, seen from the object and seen from the world."""
        return _scatter_deg(self.objects.inv() * hands), _scatter_deg(hands)


def turning_findings(
    support: Support, asked: Order, yaw_symmetry_deg: Mapping[str, float], given_xyzw: Rotations | None = None
) -> Iterator[Finding]:
    """Yield at most one finding of each kind about the rows in which the hand acts on an object.

    Args:
        yaw_symmetry_deg: declared, by object.
        given_xyzw: their rotations before it was applied.
    """
    turning = list(_turning(support, asked, yaw_symmetry_deg, given_xyzw or {}))
    yield from _worst(map(TurningRow.beside, turning))
    yield from _worst(map(TurningRow.by_other_quaternions, turning))
    yield from _worst(map(TurningRow.by_other_yaw, turning)) or _worst(map(TurningRow.scattered, turning))


def _worst(of_each: Iterable[tuple[Finding, ...]]) -> list[Finding]:
    found = [finding for findings in of_each for finding in findings]
    return sorted(found, key=lambda each: (SEVERITIES.index(each.severity), *each.numbers.values()), reverse=True)[:1]


def _turning(
    support: Support, asked: Order, yaw_symmetry_deg: Mapping[str, float], given_xyzw: Rotations
) -> Iterator[TurningRow]:
    for group, rows in support.alike(asked):
        taken_aside_m = None
        for k in touching_rows(rows) if len(group) >= MIN_TURNED else ():
            row, names = rows[k], [anchor.object_name for anchor in rows[k].anchors]
            if not all(names):
                continue
            poses = [item.object(name) for item, name in zip(group, names, strict=True)]
            aside_m = np.median(row.positions_m - [pose.position_m for pose in poses], axis=0)[:2]
            turned = [pose.quaternion_xyzw for pose in poses if pose.quaternion_xyzw is not None]
            if len(turned) == len(group):
                own = zip(group, names, turned, strict=True)
                given = [given_xyzw.get(item.id, {}).get(name, quaternion) for item, name, quaternion in own]
                symmetry_deg = next((yaw_symmetry_deg[name] for name in names if name in yaw_symmetry_deg), None)
                yield TurningRow(
                    row,
                    asked_anchor(row.anchors[0], group[0].order, asked).object_name,
                    Rotation.from_quat(turned),
                    symmetry_deg,
                    None if symmetry_deg is None else Rotation.from_quat(given),
                    aside_m,
                    taken_aside_m if row.gripper_open else None,
                    takes=k > 0 and rows[k - 1].gripper_open and not row.gripper_open,
                )
            if not row.gripper_open:
                taken_aside_m = aside_m


def _scatter_deg(rotations: Rotation) -> float:
    return float(np.median(off_mean_deg(rotations)))
