"""Requests that can be sent as they are, in this order; shown in the documentation and sent by a test."""

from itertools import pairwise
from typing import Any

from pydantic import ConfigDict


def shown(example: dict[str, Any]) -> ConfigDict:
    """Return the configuration of a pydantic model that shows `example` in the OpenAPI document."""
    return ConfigDict(json_schema_extra={"examples": [example]})


_DOWN = [1.0, 0.0, 0.0, 0.0]  # gripper pointing down
_AT_REST = [0.0] * 7
_MOVING = [0.0, 0.4, 0.0, 0.3, 0.0, 0.1, 0.0]

# The gripper moves over a red button at (0.10, 0.20, 0.80), rests, presses it, rests, rises and rests.
_PATH_M = [
    [0.16, 0.14, 0.96],
    [0.14, 0.16, 0.94],
    [0.12, 0.18, 0.92],
    [0.10, 0.20, 0.90],
    *[[0.10, 0.20, z_m] for z_m in (0.90, 0.88, 0.86, 0.84, 0.82)],
    *[[0.10, 0.20, z_m] for z_m in (0.82, 0.84, 0.86, 0.88, 0.90)],
    *[[0.10, 0.20, 0.90]] * 2,
]
EPISODE: dict[str, Any] = {
    "metadata": {
        "task": "press",
        "instruction": "press the red button",
        "objects": [{"name": "red button", "position": [0.10, 0.20, 0.80], "quaternion_xyzw": [0.0, 0.0, 0.0, 1.0]}],
        "control_frequency_hz": 10,
    },
    "trajectory": {
        "joint_velocities": [
            _AT_REST if before == here else _MOVING for before, here in pairwise([_PATH_M[0], *_PATH_M])
        ],
        "end_effector_positions": _PATH_M,
        "end_effector_quaternions_xyzw": [_DOWN] * len(_PATH_M),
        "gripper_open": [0] * len(_PATH_M),
    },
}

_CAMERA: dict[str, Any] = {
    "name": "front",
    "intrinsics": {"fx": 579.4, "fy": 579.4, "cx": 319.5, "cy": 239.5},
    "camera_to_world": [[1, 0, 0, 0.2], [0, -1, 0, 0], [0, 0, -1, 1.6], [0, 0, 0, 1]],
    "depth_scale": 0.001,
}
METADATA: dict[str, Any] = {**EPISODE["metadata"], "cameras": [_CAMERA]}

PREDICT: dict[str, Any] = {
    "task": "press",
    "instruction": "press the red button",
    "objects": [{"name": "red button", "position": [0.25, -0.10, 0.80], "quaternion_xyzw": [0.0, 0.0, 0.0, 1.0]}],
}

PLAN: dict[str, Any] = {"instruction": "press the red button twice", "objects": PREDICT["objects"]}

OUTCOME: dict[str, Any] = {"success": True, "note": "pressed at the first try"}

TASK: dict[str, Any] = {"num_demonstrations": 10, "yaw_symmetry_deg": {"red button": 0}}

EDIT: dict[str, Any] = {"left_out": False, "note": "the hand slipped at the end"}

# Labels and object models need episodes with color and depth images: put in a task, an object and ids of your own.
LABEL: dict[str, Any] = {"object": "red button", "episode_id": "ID-OF-AN-EPISODE", "clicks": {"front": [320, 240]}}

LEARN_LABELS: dict[str, Any] = {"object": "red button", "symmetric": "yaw", "dry_run": True}

LEARN: dict[str, Any] = {"objects": ["red button"], "episodes": 10}

_CUBE: dict[str, Any] = {"estimator": "cuboid", "color": "blue", "size_m": [0.05, 0.05, 0.05]}

TRY_MODEL: dict[str, Any] = {"object": "red button", "model": _CUBE, "episode_ids": ["ID-OF-AN-EPISODE"]}

POSES: dict[str, Any] = {"objects": [{"name": "blue cube", "model": _CUBE}], "cameras": [_CAMERA]}
