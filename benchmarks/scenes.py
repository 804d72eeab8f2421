"""Made-up pick-and-place episodes, small and alike, and what a robot asks about them."""

from itertools import pairwise
from typing import Any

import numpy as np

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.robot import Observation
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.trajectory import Trajectory

INSTRUCTION = "put the cube into the box"
_STEPS = 4  # frames of each move and of each rest
_MIN_M, _MAX_M = (0.0, -0.3, 0.77), (0.4, 0.3, 0.79)


def observation(seed: int) -> Observation:
    """A cube and a box somewhere on a table."""
    places_m = np.random.default_rng(seed).uniform(_MIN_M, _MAX_M, (2, 3)).round(4)
    return Observation(tuple(map(ObjectPose, ("cube", "box"), places_m, np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)))))


def trajectory(scene: Observation) -> Trajectory:
    """Above the cube, down, closed, up, above the box, opened: six keyframes at rests between straight moves."""
    cube_m, box_m = (pose.position_m for pose in scene.objects)
    up_m = np.array([0.0, 0.0, 0.12])
    stops = [((0.1, 0.0, 1.2), 1), (cube_m + up_m, 1), (cube_m, 1), (cube_m, 0)]
    stops += [(cube_m + up_m, 0), (box_m + up_m, 0), (box_m + up_m, 1)]
    positions_m: list[np.ndarray] = []
    is_open: list[int] = []
    for (start_m, before), (end_m, after) in pairwise(stops):
        positions_m += list(np.linspace(start_m, end_m, _STEPS)) + [np.asarray(end_m)] * _STEPS
        is_open += [before] * _STEPS + [after] * _STEPS
    speeds_rad_s = np.zeros((len(is_open), 7))
    speeds_rad_s[:, 0] = np.tile([0.5] * _STEPS + [0.0] * _STEPS, len(stops) - 1)
    down_xyzw = np.tile([1.0, 0.0, 0.0, 0.0], (len(is_open), 1))
    return Trajectory(speeds_rad_s, np.array(positions_m), down_xyzw, np.array(is_open))


def question(task: str, seed: int) -> dict[str, Any]:
    """The JSON body of a prediction for an unseen scene."""
    objects = [
        {"name": pose.name, "position": pose.position_m.tolist(), "quaternion_xyzw": [0.0, 0.0, 0.0, 1.0]}
        for pose in observation(seed).objects
    ]
    return {"task": task, "instruction": INSTRUCTION, "objects": objects}


def teach(client: RoboPromptClient, task: str, number: int, first_seed: int = 0) -> None:
    """Upload demonstrations."""
    for seed in range(first_seed, first_seed + number):
        scene = observation(seed)
        client.upload(task, INSTRUCTION, trajectory(scene), scene)
