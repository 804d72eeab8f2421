"""Plans placed in a scene, and whether recordings support an action: it lies where a further one might, by its row."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from app.pipeline.episode import Query
from app.pipeline.errors import UnsupportedActionError
from app.pipeline.skill import turns
from app.pipeline.skill.fit import Plan
from app.pipeline.skill.rows import Row, seen_from
from app.pipeline.skill.scene import Scene
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

SUPPORTED = 0.99  # share of further recordings whose acts are supported
USUALLY = 0.9  # share of them within the tolerance that an answer gives


@dataclass(frozen=True, eq=False)
class PlacedRow:
    """A row in an observed scene.

    Attributes:
        scene: as it is when the row is carried out, symmetric things turned as recordings have them.
        names: of objects by their keys.
        action: the row's mean in the world.
    """

    row: Row
    scene: Scene
    names: dict[str, str]
    action: EndEffectorAction

    def seen(self, action: EndEffectorAction) -> tuple[Array, Array]:
        """Return an action's offset (3,) in meters and its rotation (4,) as the row's frame sees them."""
        return seen_from(self.row.frame, action, self.scene)

    @property
    def tolerance(self) -> tuple[float, float]:
        """How far recordings usually are from the mean, in meters and degrees along one coordinate."""
        within = self.row.within(USUALLY)
        return float(within[:3].max()), float(np.degrees(within[3:].max()))

    @property
    def object_name(self) -> str:
        """The name of the object that the place follows; empty where it follows none."""
        return next((self.names[source.one] for source in self.row.frame.place if source.one), "")

    @property
    def described(self) -> str:
        """What the place follows, in words."""
        return ", ".join(source.named(self.names) for source in dict.fromkeys(self.row.frame.place))

    def off(self, action: EndEffectorAction) -> Array:
        """Return how far (6,) an action is from the mean along the frame's axes, in m and rad."""
        back = turns.inverse(self.scene.axes(self.row.frame.axes))
        place = turns.rotated(back, action.position_m - self.action.position_m)
        turn = turns.product(turns.inverse(self.action.quaternion_xyzw), action.quaternion_xyzw)
        off: Array = np.abs(np.concatenate([place, turns.log(turn)]))
        return off

    def within(self, rounding: Array) -> Array:
        """Return how far (6,) from the mean an action is supported."""
        return self.row.within(SUPPORTED) + rounding

    def supports(self, action: EndEffectorAction, rounding: Array) -> bool:
        """Return whether recordings support an action, which text may have rounded by (6,) m and rad."""
        near = bool((self.off(action) <= self.within(rounding)).all())
        return near and action.gripper_open == self.action.gripper_open

    def away(self, action: EndEffectorAction) -> float:
        """Return how far an action is from the mean, in scales of the predictive."""
        return float(np.linalg.norm(self.off(action) / self.row.scale))

    def beyond(self, action: EndEffectorAction) -> tuple[float, float]:
        """Return how far an action is beyond the farthest recording, in meters and degrees; 0 within."""
        farther = np.maximum(self.off(action) - np.abs(self.row.residuals).max(axis=1), 0)
        return float(np.linalg.norm(farther[:3])), float(np.degrees(np.linalg.norm(farther[3:])))


PlacedPlan = tuple[PlacedRow, ...]


def placed_plan(plan: Plan, query: Query, scene: Scene) -> PlacedPlan:
    """Return a plan's rows in the scene of a query."""
    names = {query.order.placeholder(pose.name): pose.name for pose in query.objects}
    turned = plan.as_shown(scene)
    return tuple(PlacedRow(row, turned, names, action) for row, action in zip(plan.rows, plan.at(scene), strict=True))


def joined(plans: Sequence[PlacedPlan]) -> PlacedPlan:
    """Return plans that are carried out one after the other as one."""
    return tuple(chain.from_iterable(plans))


class SupportGuard:
    """Checks the actions of one reply in their order against the plans that they may carry out.

    Args:
        plans: placed in the observed scene.
        rounding: (6,) m and rad by which the text of a prompt and of a reply may round.
        num_before: number of actions of earlier parts of the instruction; indices in errors count them.
    """

    def __init__(self, plans: Sequence[PlacedPlan], rounding: Array, num_before: int = 0) -> None:
        self._plans = list(plans)
        self._rounding = rounding
        self._before = num_before
        self._index = 0

    def check(self, action: EndEffectorAction) -> PlacedRow:
        """Check the next action, and return the row that it carries out.

        Raises:
            UnsupportedActionError: naming its index, and what was expected.
        """
        index = self._index
        going_on = [plan for plan in self._plans if index < len(plan)]
        if not going_on:
            most = self._before + max(map(len, self._plans), default=0)
            message = "is one more than demonstrated"
            raise UnsupportedActionError(self._before + index, message, f"at most {most} actions")
        supporting = [plan for plan in going_on if plan[index].supports(action, self._rounding)]
        if not supporting:
            nearest = min((plan[index] for plan in going_on), key=lambda row: row.away(action))
            raise self._unsupported(action, nearest)
        self._plans, self._index = supporting, index + 1
        return min((plan[index] for plan in supporting), key=lambda row: row.away(action))

    def pass_by(self) -> None:
        """Continue after an action that `check` refused, with every plan that has a row there."""
        self._plans = [plan for plan in self._plans if self._index < len(plan)] or self._plans
        self._index += 1

    def finish(self) -> None:
        """Check that the reply may end here.

        Raises:
            UnsupportedActionError: if no demonstration ends so early.
        """
        if all(len(plan) != self._index for plan in self._plans):
            missing, fewest = self._before + self._index, self._before + min(map(len, self._plans))
            raise UnsupportedActionError(missing, "is missing: the reply ends too early", f"{fewest} actions")

    def _unsupported(self, action: EndEffectorAction, row: PlacedRow) -> UnsupportedActionError:
        index, off, within, of = self._before + self._index, row.off(action), row.within(self._rounding), row.described
        c = int((off / within).argmax())
        if off[c] <= within[c]:
            state = "open" if action.gripper_open else "closed"
            message = f"has the gripper {state}"
            return UnsupportedActionError(index, message, "the gripper as demonstrations have it there")
        if c < 3:
            expected = f"{row.action.position_m.round(3).tolist()} m"
            bound = f"within {100 * within[c]:.1f} cm of {expected}, seen from {of}"
            return UnsupportedActionError(index, f"is {100 * off[c]:.1f} cm from where demonstrations go", bound)
        bound = f"within {np.degrees(within[c]):.1f} degrees, seen from {of}"
        said = f"is turned by {np.degrees(off[c]):.1f} degrees from the demonstrations"
        return UnsupportedActionError(index, said, bound)
