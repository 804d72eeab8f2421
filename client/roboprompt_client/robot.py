"""What a robot must offer: the `Robot` Protocol, and the `Observation` of a scene."""

import json
import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar, runtime_checkable

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import settle
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, Pose, object_from_json

Item = TypeVar("Item")
log = logging.getLogger(__name__)
OBJECTS = 'JSON: [{"name": "cube", "position": [x, y, z]}], meters, each with "quaternion_xyzw" where it is known'


@dataclass(frozen=True, init=False)
class Observation:
    """What the robot sees before it moves: object poses that it knows itself, and calibrated images of its cameras.

    Attributes:
        objects, frames: given as one or several, kept as tuples.
        to_find: names of objects that the service shall find in the images, with the task's object models.
        end_effector: the pose before the first action; needed where the task bounds steps.
        mask_ids: by object name, the ids of its pixels in the frames' masks; instead of a pose or beside it.
    """

    objects: tuple[ObjectPose, ...]
    frames: tuple[RgbdFrame, ...]
    to_find: tuple[str, ...]
    end_effector: Pose | None
    mask_ids: Mapping[str, Sequence[int]]

    def __init__(
        self,
        objects: ObjectPose | Iterable[ObjectPose] = (),
        frames: RgbdFrame | Iterable[RgbdFrame] = (),
        to_find: str | Iterable[str] = (),
        end_effector: Pose | None = None,
        mask_ids: Mapping[str, Sequence[int]] | None = None,
    ) -> None:
        settle(
            self,
            objects=_several("objects", objects, ObjectPose),
            frames=_several("frames", frames, RgbdFrame),
            to_find=_several("to_find", to_find, str),
            end_effector=end_effector,
            mask_ids=dict(mask_ids or {}),
        )


def _several(field: str, given: Item | Iterable[Item], kind: type[Item]) -> tuple[Item, ...]:
    """Return one item or several as a tuple; raises InvalidInputError if one is of another kind."""
    items = tuple(given) if isinstance(given, Iterable) and not isinstance(given, kind) else (given,)
    for item in items:
        if not isinstance(item, kind):
            raise InvalidInputError(field, f"has a {type(item).__name__}", f"one or several of {kind.__name__}")
    return items


def observation_from_file(field: str, path: Path) -> Observation:
    """Return an observation with the objects of a JSON file.

    Args:
        field: the field that an error names.

    Raises:
        InvalidInputError: if the file cannot be read, or is not a list of objects.
    """
    try:
        return Observation(map(object_from_json, json.loads(path.read_text())))
    except InvalidInputError as error:
        raise InvalidInputError(f"{field}: {path}: {error.field}", error.message, OBJECTS) from error
    except (OSError, ValueError) as error:
        raise InvalidInputError(field, f"{path} cannot be read: {error}", f"a file with {OBJECTS}") from error
    except (KeyError, TypeError, AttributeError) as error:
        raise InvalidInputError(field, f"{path} is not a list of objects", OBJECTS) from error


class Robot(Protocol):
    """An arm with a parallel gripper and calibrated cameras."""

    def observe(self) -> Observation:
        """Return the scene as it is now; called while the arm rests."""

    def execute(self, action: EndEffectorAction) -> None:
        """Move the end effector to the action's pose, then set the gripper; return when both are done.

        Raises:
            MotionError: if the pose cannot be reached or was not reached.
        """

    def stop(self) -> None:
        """Stop the arm where it is; safe to call at any time and from any thread."""


@runtime_checkable
class ChecksPlans(Protocol):
    """A robot that knows before it moves what is out of its reach."""

    def check_plan(self, actions: Sequence[EndEffectorAction]) -> None:
        """Raise MotionError, naming the action, if one of a plan's actions cannot be reached."""


def stop_after_error(robot: Robot) -> None:
    """Stop the robot; an error of its `stop` is logged, so that it does not hide the one for which it stops."""
    try:
        robot.stop()
    except Exception as error:
        log.error("the stop was not confirmed: %s", error or type(error).__name__)
