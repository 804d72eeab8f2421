"""A row in which the hand acts: how demonstrations of it scatter, and what explains that."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding, rules
from app.pipeline.findings.rules import Rule
from app.pipeline.geometry import least_apart_rad
from app.pipeline.order.order import Order
from app.pipeline.plans.acting import slides_on
from app.pipeline.plans.rows import PlanRow, left_out_errors_m, of_a_way
from app.pipeline.plans.ways import two_ways
from app.pipeline.representation.anchor_scatter import MIN_SCATTERED, TURNED_SHARE, much_less, scatters_m
from app.pipeline.representation.anchors import asked_anchor
from app.pipeline.thresholds import M_PER_RAD
from roboprompt_client.types.arrays import Array

AXES_SHARES = np.array([TURNED_SHARE, 0.4])  # the share of the scatter of places and rotations that other axes leave
CIRCLE_SHARE = 0.25  # the share of the scatter by which the median distance from the axis may vary on a circle
EXPLAINED_M = 0.007  # the least scatter that is worth an explanation
LEFT = 0.2  # the share of the scatter (leave one out) that is left where something explains it: then it is no noise
FEWEST_EXPLAINED = 5  # demonstrations
FEWEST_IN_CORE = 4  # demonstrations that agree closely
CORE_SHARE = 0.2  # of the distance of the others, within which they do
FREEDOM = 6  # degrees of freedom (demonstrations less fitted numbers) below which proportionally less may be left
NO_TURN_DEG = 2.0  # a hand that follows a yaw turns by more
VARIES_M = 0.005  # what varies by less explains nothing
PLACE_VARIES_M = 0.02  # of an object in one place: twice the paper's noise of poses along an axis


@dataclass(frozen=True, eq=False)
class ActingRow:
    """A row in which the hand acts on something, itself or with a held object.

    Attributes:
        shown, rows: of its plan.
        touches: whether the hand itself acts; what is held may act anywhere, as in a bin.
        asked: the requested instruction.
        yaw_symmetry_deg: declared, by object.
    """

    shown: Sequence[Demonstration]
    rows: Sequence[PlanRow]
    index: int
    touches: bool
    asked: Order
    yaw_symmetry_deg: Mapping[str, float]

    @cached_property
    def row(self) -> PlanRow:
        """The row itself; of a hand that slides on to the next row only what is beside its way counts."""
        row = self.rows[self.index]
        way_m = _way_m(row, self.rows[self.index + 1]) if slides_on(self.rows, self.index) else None
        if way_m is None:
            return row
        off_m = row.offsets_m - row.center_m
        directions = way_m / np.maximum(np.linalg.norm(way_m, axis=1, keepdims=True), 1e-9)
        along_m = np.einsum("nx,nx->n", off_m, directions)[:, None] * directions
        return replace(row, offsets_m=row.offsets_m - along_m)

    @property
    def loosely(self) -> bool:
        """Whether the hand releases something, or acts with a held object."""
        return not self.touches or (
            self.index > 0 and self.row.gripper_open and not self.rows[self.index - 1].gripper_open
        )

    @property
    def ends_slide(self) -> bool:
        """Whether the plan ends here with a slide: how far the hand pushes varies more than where it grasps."""
        return 0 < self.index == len(self.rows) - 1 and slides_on(self.rows, self.index - 1)

    @property
    def seen_from(self) -> str:
        """The object or frame that the row is relative to, by its name in the observed scene."""
        anchor = asked_anchor(self.row.anchors[0], self.shown[0].order, self.asked)
        return anchor.object_name or f"the {anchor.frame}"

    @property
    def is_round(self) -> bool:
        """Whether the object that the row follows has a declared yaw symmetry."""
        return self.row.anchors[0].object_name in self.yaw_symmetry_deg

    @property
    def text(self) -> str:
        """The row in messages."""
        return f"{len(self.shown)} demonstrations act (action {self.index + 1}, relative to {self.seen_from})"

    def findings(self, rule: Rule, value: float, message: str) -> tuple[Finding, ...]:
        """Return the finding about this row, if the value has a severity."""
        row = self.row
        numbers = {"scatter_m": row.scatter_m, "way_off_m": row.way_off_m, "center_off_m": row.center_off_m}
        return rule.findings(value, message, f"actions[{self.index}]", **numbers)

    def by_other_axes(self) -> tuple[float, float]:
        """Return the scatter of places (m) and rotations (degrees), where the other axes of the object fit better.

        Place and hand then need different axes, and demonstrations are too few or too noisy to choose them separately.
        """
        row, names = self.row, {anchor.object_name for anchor in self.row.anchors}
        poses = [item.object(a.object_name) for item, a in zip(self.shown, row.anchors, strict=True) if all(names)]
        if (
            len(poses) < MIN_SCATTERED
            or names & self.yaw_symmetry_deg.keys()
            or any(pose.quaternion_xyzw is None for pose in poses)
        ):
            return 0.0, 0.0
        world_m, own_m = (scatter_m[:, self.index] for scatter_m in scatters_m(self.shown, row.anchors))
        turn = np.array([row.anchors[0].place_turns, row.anchors[0].hand_turns])
        off_m, other_m = np.where(turn, own_m, world_m), np.where(turn, world_m, own_m)
        place_m, hand_m = np.where(much_less(other_m, off_m, AXES_SHARES), off_m, 0.0).tolist()
        if row.anchors[0].frame == "ow":  # no noise of poses turns the hand in the world: it follows something else
            hand_m = max(hand_m, float(world_m[1]))
        return place_m, math.degrees(hand_m / M_PER_RAD)

    def explained_m(self) -> tuple[float, str]:
        """Return the largest distance from the row's center, and what explains it; (0, "") if nothing does.

        A camera that drifts explains it by the order of the recordings, another tool by where the hand starts (both
        are measured at another point of it), a wrong scale or a turned frame by where the object stands, and a place
        that depends on two objects by where the other one stands, seen from the first.
        """
        row = self.row
        if len(self.shown) < FEWEST_EXPLAINED or row.scatter_m < EXPLAINED_M or not row.anchors[0].object_name:
            return 0.0, ""
        followed = zip(self.shown, row.anchors, strict=True)
        followed_m = np.array([item.object(anchor.object_name).position_m for item, anchor in followed])
        seen_m = (row.positions_m - followed_m, row.offsets_m)  # along the world's axes, and the row's own
        for name, inputs in self._causes(followed_m).items():
            varied = inputs[:, inputs.std(axis=0) > VARIES_M]
            freedom = len(self.shown) - varied.shape[1] - 1
            most_left = LEFT * min(1, freedom / FREEDOM) * (row.off_m**2).sum()
            if varied.shape[1] and any((left_out_errors_m(varied, m) ** 2).sum() < most_left for m in seen_m):
                return float(row.off_m.max()), name
        return 0.0, ""

    def _causes(self, followed_m: Array) -> dict[str, Array]:
        """Return (N, K) quantities that may explain scatter about an object at `followed_m` (N, 3), by their text."""
        number = len(self.shown)
        starts_m = [item.start.position_m for item in self.shown if item.start is not None]
        causes = {
            "the order of the recordings": np.linspace(0, 1, number)[:, None],
            "where the hand starts": np.array(starts_m if len(starts_m) == number else np.zeros((number, 3))),
            f"the place of {self.row.anchors[0].object_name}": followed_m[:, followed_m.std(axis=0) > PLACE_VARIES_M],
        }
        # what is held may depend on anything on its way
        for poses in zip(*(item.ordered_objects for item in self.shown), strict=False) if self.touches else ():
            other = all(pose.name != anchor.object_name for pose, anchor in zip(poses, self.row.anchors, strict=True))
            if other:
                places_m = np.array([pose.position_m for pose in poses])
                causes.setdefault(f"the place of {poses[0].name}", places_m - followed_m)
        return causes

    def places_in_two_m(self) -> float:
        """Return the distance between two clusters of places where the hand itself acts; 0 for one cluster."""
        row, least_m = self.row, rules.SCATTER_OF_PLACES_IN_TWO.levels["danger"]
        if self.loosely or (clusters := two_ways(row.unturned, least_m=least_m)) is None:
            return 0.0
        return float(np.linalg.norm(row.offsets_m[clusters].mean(axis=0) - row.offsets_m[~clusters].mean(axis=0)))

    def beside_core_m(self) -> float:
        """Return how far more than a third are from the place at which half agree closely; 0 if none is so clear.

        Noise gives no such gap. Only where the hand itself acts.
        """
        offsets_m, half = self.row.offsets_m, len(self.shown) // 2
        if half < FEWEST_IN_CORE or self.loosely:
            return 0.0
        apart_m = np.sort(np.linalg.norm(offsets_m[:, None] - offsets_m[None], axis=2), axis=1)
        core = int(apart_m[:, half - 1].argmin())
        off_m = of_a_way(apart_m[core])
        return off_m if apart_m[core, half - 1] < CORE_SHARE * off_m else 0.0

    def hands_in_two_deg(self) -> float:
        """Return the angle between two clusters of the hand's rotations, by turns that leave the object unchanged.

        0 for one cluster, or an object that every turn leaves unchanged.
        """
        row, symmetry_deg = self.row, self.yaw_symmetry_deg.get(self.row.anchors[0].object_name or "", 360.0)
        only_turns = replace(row, offsets_m=np.zeros_like(row.offsets_m), center_m=np.zeros(3))
        least_m = M_PER_RAD * math.radians(rules.SCATTER_OF_HANDS_IN_TWO.levels["danger"])
        if symmetry_deg == 0 or (clusters := two_ways(only_turns, least_m=least_m)) is None:
            return 0.0
        means = row.rotations[clusters].mean(), row.rotations[~clusters].mean()
        return math.degrees(least_apart_rad(*means, symmetry_deg).item())

    def on_a_circle_m(self) -> float:
        """Return the scatter of places on a circle about an object's vertical axis; 0 elsewhere."""
        if not self.row.anchors[0].object_name:
            return 0.0
        radii_m = np.linalg.norm(self.row.offsets_m[:, :2], axis=1)
        off_circle_m = float(np.median(np.abs(radii_m - np.median(radii_m))))
        return self.row.scatter_m if off_circle_m < CIRCLE_SHARE * self.row.scatter_m else 0.0

    def on_an_arc_m(self) -> float:
        """Return the same on one side of an object with which the places do not turn; of few demonstrations 0.

        Where neither a hand turns nor a rotation was sent, nothing says that a yaw matters.
        """
        row = self.row
        if len(self.shown) < FEWEST_EXPLAINED or row.anchors[0].place_turns or not self._yaw_matters:
            return 0.0
        aside_m = float(np.linalg.norm(row.offsets_m[:, :2].mean(axis=0)))
        return self.on_a_circle_m() if aside_m > row.scatter_m else 0.0

    @property
    def _yaw_matters(self) -> bool:
        """Whether hands turn, or the rotation of the object that they follow was sent."""
        hands = self.row.hands
        turn_deg = np.degrees((hands[0].inv() * hands).magnitude())
        names = [anchor.object_name for anchor in self.row.anchors]
        followed = [item.object(name) for item, name in zip(self.shown, names, strict=True) if name]
        return bool(turn_deg.max() > NO_TURN_DEG) or any(pose.quaternion_xyzw is not None for pose in followed)


def _way_m(here: PlanRow, other: PlanRow) -> Array | None:
    """Return the ways (N, 3) between the centers of two rows, along the axes of `here`; None if their axes differ."""
    if here.anchors == other.anchors:
        return np.tile(other.center_m - here.center_m, (len(here.offsets_m), 1))
    if any(anchor.place_turns for row in (here, other) for anchor in row.anchors):
        return None
    centers_m = [row.positions_m - row.offsets_m + row.center_m for row in (here, other)]
    way_m: Array = centers_m[1] - centers_m[0]
    return way_m
