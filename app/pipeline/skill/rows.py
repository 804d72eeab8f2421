"""A row of a skill: where the hand goes, as six Student t distributions in a task-parameterised frame."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from app.pipeline.skill import turns
from app.pipeline.skill.evidence import Posterior, two_sided_p
from app.pipeline.skill.frames import Frame
from app.pipeline.skill.scene import Scene
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

AXES = np.arange(3)
COORDINATES = ("x", "y", "z", "turn about x", "turn about y", "turn about z")


@dataclass(frozen=True, eq=False)
class Row:
    """A row in its frame: three coordinates of the place (m), three of the rotation (rad).

    Attributes:
        place: (3,) m from the frame's origins along its axes; turn: (4,) relative to the frame's hand.
        posterior: (6,) of the residuals.
        residuals: (6, N) of the demonstrations.
        log_evidence: of the row in its frame, with the frame's log prior; `rivals`: the same of the best frame with
            its origin at each object.
    """

    frame: Frame
    place: Array
    turn: Array
    posterior: Posterior
    residuals: Array
    gripper_open: bool
    log_evidence: float
    rivals: Mapping[str, float]

    @property
    def scale(self) -> Array:
        """(6,) of a further demonstration, in m and rad."""
        return self.posterior.scale()

    def within(self, share: float) -> Array:
        """Return how far (6,) from the mean this share of further demonstrations is, along each coordinate."""
        found: Array = stdtrit(self.posterior.dof, (1 + share) / 2) * self.scale
        return found

    def at(self, scene: Scene) -> EndEffectorAction:
        """Return the row's mean in a scene."""
        place, turn = placed([self], scene)
        return EndEffectorAction(place[0], turn[0], self.gripper_open)

    def residual(self, action: EndEffectorAction, scene: Scene) -> Array:
        """Return how far (6,) an action is from the row's mean, along the frame's axes, in m and rad."""
        _, turn = placed([self], scene)
        seen, _ = seen_from(self.frame, action, scene)
        off = turns.log(turns.product(turns.inverse(turn[0]), action.quaternion_xyzw))
        return np.concatenate([seen - self.place, off])

    def surprise(self, action: EndEffectorAction, scene: Scene) -> Array:
        """Return how often (6,) chance alone puts a demonstration as far off as an action."""
        return two_sided_p(self.residual(action, scene), self.scale, self.posterior.dof)


def placed(rows: Sequence[Row], scene: Scene) -> tuple[Array, Array]:
    """Return places (R, 3) and rotations (R, 4) of R rows in one scene; NaN where its hand is not known but needed."""
    frames = [row.frame for row in rows]
    return posed(frames, np.array([row.place for row in rows]), np.array([row.turn for row in rows]), scene)


def posed(frames: Sequence[Frame], places: Array, rotations: Array, scene: Scene) -> tuple[Array, Array]:
    """Return places (R, 3) and rotations (R, 4) in the world of what is seen from R frames of a scene."""
    axes = np.array([scene.axes(frame.axes) for frame in frames])
    hands = np.array([scene.axes(frame.hand) for frame in frames])
    origins = np.array([_origins(frame, scene) for frame in frames])
    seen = turns.rotated(turns.inverse(axes)[:, None], origins)[:, AXES, AXES]
    return turns.rotated(axes, seen + places), turns.product(hands, rotations)


def seen_from(frame: Frame, action: EndEffectorAction, scene: Scene) -> tuple[Array, Array]:
    """Return place (3,) and rotation (4,) of an action as a frame of a scene sees it."""
    back = turns.inverse(scene.axes(frame.axes))
    place: Array = turns.rotated(back, action.position_m - _origins(frame, scene))[AXES, AXES]
    return place, turns.product(turns.inverse(scene.axes(frame.hand)), action.quaternion_xyzw)


def _origins(frame: Frame, scene: Scene) -> Array:
    return np.array([scene.origin(source) for source in frame.place])
