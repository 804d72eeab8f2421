"""What a robot must offer so that the service can teach it and move it."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import settle
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, Pose, object_from_json

OBJECTS = 'JSON: [{"name": "cube", "position": [x, y, z]}], meters, each with "quaternion_xyzw" where it is known'


@dataclass(frozen=True, init=False)
class Observation:
    """What the robot sees before it moves: poses where it knows them itself, calibrated images where it has cameras.

    Attributes:
        objects, frames: given as one or as many, kept as tuples.
        to_find: the names of objects that the service is to find in the images by the task's object models.
        end_effector: where the arm is: the way to the first target begins there. Needed where the task bounds steps.
        mask_ids: by object the ids that its pixels have in the frames' masks, where a detector of one's own makes some.
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
            objects=(objects,) if isinstance(objects, ObjectPose) else tuple(objects),
            frames=(frames,) if isinstance(frames, RgbdFrame) else tuple(frames),
            to_find=(to_find,) if isinstance(to_find, str) else tuple(to_find),
            end_effector=end_effector,
            mask_ids=dict(mask_ids or {}),
        )


def observation_from_file(field: str, path: Path) -> Observation:
    """The objects of a JSON file.

    Args:
        field: what an error names.

    Raises:
        InvalidInputError: if it cannot be read, or is no list of objects.
    """
    try:
        return Observation(map(object_from_json, json.loads(path.read_text())))
    except InvalidInputError as error:
        raise InvalidInputError(f"{field}: {path}: {error.field}", error.message, OBJECTS) from error
    except (OSError, ValueError) as error:
        raise InvalidInputError(field, f"{path} cannot be read: {error}", f"a file with {OBJECTS}") from error
    except (KeyError, TypeError, AttributeError) as error:
        raise InvalidInputError(field, f"{path} is no list of objects", OBJECTS) from error


class Robot(Protocol):
    """An arm with a parallel gripper and calibrated cameras."""

    def observe(self) -> Observation:
        """The scene as it is now; called while the arm rests."""
        ...

    def execute(self, action: EndEffectorAction) -> None:
        """Move the end effector to the action's pose, then set the gripper; returns when both are done.

        Raises:
            MotionError: if the pose cannot be reached or the motion did not arrive.
        """
        ...

    def stop(self) -> None:
        """Hold still where the arm is; safe to call at any time."""
        ...
