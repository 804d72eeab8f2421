"""A part: what the hand does at one object in several demonstrations, placed at any object of the same kind.

What the hand grasps moves with it until it lets go; a `SceneState` follows where objects are meanwhile.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration, Query
from app.pipeline.order.words import noun_of, phrase_of
from app.pipeline.skill import turns
from app.pipeline.skill.frames import Frame
from app.pipeline.skill.rows import posed
from app.pipeline.skill.scene import GRASPED_M, WORLD, Scene, Source
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

Objects = tuple[ObjectPose, ...]


@dataclass(frozen=True, eq=False)
class SceneState:
    """A scene between two actions.

    Attributes:
        objects: where they are. What the hand has put down counts as moved from the hand's next grasp on: the retreat
            from it still belongs to the place where it was put.
        hand: the last action; None before the first.
        held: the object in the hand, and the hand's pose when it grasped it.
        put_down: the object that the hand has put down since its last grasp, at its new pose.
    """

    objects: Objects
    hand: EndEffectorAction | None = None
    held: tuple[ObjectPose, EndEffectorAction] | None = None
    put_down: ObjectPose | None = None

    def after(self, action: EndEffectorAction) -> "SceneState":
        """Return the scene after a further action."""
        was_open = self.hand is not None and self.hand.gripper_open
        if was_open and not action.gripper_open:
            moved = {} if self.put_down is None else {self.put_down.name: self.put_down}
            objects = tuple(moved.get(pose.name, pose) for pose in self.objects)
            return SceneState(objects, action, _grasped(objects, action))
        if self.held is not None and action.gripper_open:
            return SceneState(self.objects, action, put_down=_moved(*self.held, action))
        return replace(self, hand=action)


def scenes_before(demonstration: Demonstration) -> list[SceneState]:
    """Return the scene before each action."""
    return list(accumulate(demonstration.actions[:-1], SceneState.after, initial=SceneState(demonstration.objects)))


def _grasped(objects: Objects, hand: EndEffectorAction) -> tuple[ObjectPose, EndEffectorAction] | None:
    nearest = min(objects, key=lambda pose: float(np.linalg.norm(pose.position_m - hand.position_m)), default=None)
    if nearest is None or np.linalg.norm(nearest.position_m - hand.position_m) > GRASPED_M:
        return None
    return nearest, hand


def _moved(pose: ObjectPose, grasp: EndEffectorAction, release: EndEffectorAction) -> ObjectPose:
    turn = Rotation.from_quat(release.quaternion_xyzw) * Rotation.from_quat(grasp.quaternion_xyzw).inv()
    position_m = release.position_m + turn.apply(pose.position_m - grasp.position_m)
    turned = None if pose.quaternion_xyzw is None else (turn * Rotation.from_quat(pose.quaternion_xyzw)).as_quat()
    return ObjectPose(pose.name, position_m, turned)


class Spot(NamedTuple):
    """What an action is relative to.

    Attributes:
        code: of the axes: `w` of the world, `o` of the object, `ow` of the object for the place and of the world for
            the hand, `wo` the reverse.
        leans: whether the object's whole rotation turns these, not its yaw.
        was: the place that the object had at first; otherwise where it is now.
        keeps: the hand's rotation is relative to the one before: what it holds keeps its turn.
    """

    object_name: str
    code: str
    leans: bool
    was: bool
    keeps: bool

    @property
    def frame(self) -> Frame:
        """The frame in a scene whose objects have their names as keys."""
        at, own = (Source(kind, self.object_name) for kind in ("object", "leaning" if self.leans else "object"))
        axes, hand = (own if code == "o" else WORLD for code in (self.code[0], self.code[-1]))
        return Frame((at, at, at), axes, hand)


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
        spot = self.spot
        return kind_of(spot.object_name), spot.was, spot.code, spot.keeps, self.gripper_open


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

    def placed(self, object_name: str, scene: SceneState, observed: Query) -> Iterator[EndEffectorAction]:
        """Yield its actions at an object.

        Args:
            scene: as the actions before it leave it.
            observed: the scene before all actions.
        """
        hand = scene.hand
        for action in self.actions:
            at = Query("", observed.objects if action.spot.was else scene.objects)
            frame = action.spot._replace(object_name=object_name).frame
            (position_m,), (turn,) = posed([frame], action.offset_m[None], action.rotation_xyzw[None], Scene.of(at))
            if action.spot.keeps:
                assert hand is not None
                turn = turns.product(hand.quaternion_xyzw, action.rotation_xyzw)
            (hand,) = EndEffectorAction.many(position_m[None], turn[None], [action.gripper_open])
            yield hand


def kind_of(name: str) -> str:
    """Return the noun of an object's name: block for `red block`."""
    return noun_of(phrase_of(name))
