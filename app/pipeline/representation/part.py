"""A part: what the hand does at one object in several demonstrations, placed at any object of the same kind."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from scipy.spatial.transform import Rotation

from app.pipeline.episode import Query
from app.pipeline.order.words import noun_of, phrase_of
from app.pipeline.representation.anchors import Anchor, Frame, anchor_pose
from app.pipeline.representation.carried import SceneState
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction


class Spot(NamedTuple):
    """What an action is relative to.

    Attributes:
        was: the place that the object had at first; otherwise where it is now.
        keeps: the hand's rotation is relative to the one before: what it holds keeps its turn.
    """

    object_name: str
    was: bool
    frame: Frame
    keeps: bool


@dataclass(frozen=True, eq=False)
class SpotAction:
    """An action relative to a spot: offset (3,) in meters, rotation (4,), and the gripper."""

    spot: Spot
    offset_m: Array
    rotation_xyzw: Array
    gripper_open: bool

    @property
    def form(self) -> tuple[object, ...]:
        """Equal for actions that may be the same, at objects of one kind."""
        return kind_of(self.spot.object_name), *self.spot[1:], self.gripper_open


@dataclass(frozen=True, eq=False)
class Part:
    """What the hand does at one object: it grasps it, releases something there, or reaches for it.

    Attributes:
        words: its name in replies: `grasp`, `release 2`, `release 18 cm left of`.
        actions: relative to the object at which some demonstration has it.
    """

    words: str
    actions: tuple[SpotAction, ...]

    @property
    def kind(self) -> str:
        """The noun of the objects that it can be carried out at."""
        return kind_of(self.actions[0].spot.object_name)

    def text(self, object_name: str) -> str:
        """The part at an object as it stands in replies."""
        was = self.actions[0].spot.was
        return f"{self.words} where {object_name} was" if was else f"{self.words} {object_name}"

    def placed(
        self, object_name: str, scene: SceneState, observed: Query, tilted: frozenset[str]
    ) -> Iterator[EndEffectorAction]:
        """Yield its actions at an object.

        Args:
            scene: as the actions before it leave it.
            observed: the scene before all actions.
            tilted: objects whose frame `o` is their full rotation.
        """
        hand = scene.hand
        for action in self.actions:
            at = observed if action.spot.was else Query("", scene.objects)
            pose = anchor_pose(Anchor(object_name, action.spot.frame), at, tilted)
            if action.spot.keeps:
                assert hand is not None
                pose = pose._replace(hand_axes=Rotation.from_quat(hand.quaternion_xyzw))
            position_m, rotation = pose.placed(action.offset_m, Rotation.from_quat(action.rotation_xyzw))
            hand = EndEffectorAction(position_m, rotation.as_quat(canonical=True), action.gripper_open)
            yield hand


def kind_of(name: str) -> str:
    """Return the noun of an object's name: block for `red block`."""
    return noun_of(phrase_of(name))
