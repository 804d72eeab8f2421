"""The instructions of Meta-World's tasks, and the objects of its scenes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roboprompt_client.types.poses import ObjectPose

Floats = NDArray[np.float64]
Command = NDArray[np.floating[Any]]
"""(4) where the hand shall go, each axis in -1..1 of a step's length, and the gripper's command."""

# Of Meta-World's observation (39): where the hand, two objects and the goal are, in meters of its world frame.
HAND, OBJECT_1, OBJECT_2, GOAL = slice(0, 3), slice(4, 7), slice(11, 14), slice(36, 39)
FINGERS = 3  # how far the fingers are apart: 1 open, 0 closed
SAME_PLACE_M = 1e-3


@dataclass(frozen=True)
class Task:
    """One of Meta-World's tasks.

    Attributes:
        instruction: what the service is asked for.
        object_names: of the places `OBJECT_1`, `OBJECT_2` and `GOAL`; an empty one is not reported.
    """

    instruction: str
    object_names: tuple[str, str, str]


TASKS: Mapping[str, Task] = {
    "assembly": Task("put the nut onto the peg", ("nut", "", "peg")),
    "basketball": Task("dunk the ball into the basket", ("ball", "", "basket")),
    "bin-picking": Task("grasp the cube and place it in the other bin", ("cube", "", "other bin")),
    "box-close": Task("grasp the lid and close the box with it", ("lid", "", "box")),
    "button-press": Task("press the button", ("button", "", "pressed place")),
    "coffee-push": Task("push the mug to the goal", ("mug", "", "goal")),
    "dial-turn": Task("turn the dial by 180 degrees", ("dial", "", "goal")),
    "disassemble": Task("pick the nut off the peg", ("nut", "", "goal")),
    "door-open": Task("open the door with a revolving joint", ("door", "", "goal")),
    "drawer-close": Task("push and close the drawer", ("drawer", "", "goal")),
    "faucet-open": Task("turn the faucet counter-clockwise", ("faucet", "", "goal")),
    "hammer": Task("hammer the nail into the wall", ("hammer", "nail", "goal")),
    "handle-press": Task("press the handle down", ("handle", "", "goal")),
    "peg-insert-side": Task("insert the peg into the hole sideways", ("peg", "", "hole")),
    "lever-pull": Task("pull the lever up by 90 degrees", ("lever", "", "goal")),
    "pick-place": Task("pick the puck up and bring it to the goal", ("puck", "", "goal")),
    "plate-slide-back": Task("get the plate from the cabinet", ("plate", "", "goal")),
    "plate-slide": Task("slide the plate into the cabinet", ("plate", "", "cabinet")),
    "reach-wall": Task("bypass the wall and reach the goal", ("puck", "", "goal")),
    "push-back": Task("pull the puck back to the goal", ("puck", "", "goal")),
    "push": Task("push the puck to the goal", ("puck", "", "goal")),
    "shelf-place": Task("pick the block and place it onto the shelf", ("block", "", "shelf")),
    "stick-pull": Task("grasp the stick and pull the box with it", ("stick", "box", "goal")),
    "sweep-into": Task("sweep the block into the hole", ("block", "", "hole")),
    "window-open": Task("push and open the window", ("window", "", "goal")),
}


def observed_objects(task: Task, observation: Floats) -> tuple[ObjectPose, ...]:
    """Names and positions as a perception system would report them. No task varies a rotation.

    A place that is not filled (all zeros) or that an object before it has is left out.

    Args:
        observation: (39) at the start of a scene.
    """
    objects: list[ObjectPose] = []
    for name, where in zip(task.object_names, (OBJECT_1, OBJECT_2, GOAL), strict=True):
        place_m = observation[where]
        known = any(np.allclose(place_m, each.position_m, atol=SAME_PLACE_M) for each in objects)
        if name and place_m.any() and not known:
            objects.append(ObjectPose(name, place_m))
    return tuple(objects)
