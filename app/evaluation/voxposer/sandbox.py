"""A language model's program, run in a sandboxed process: no files, network or environment, and little time."""

import json
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import app
from app.evaluation.failures import ProgramRefusedError
from app.evaluation.voxposer.voxels import SIZE, Voxels
from app.pipeline.workspace import Workspace
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

MAX_VOXELS = 400  # of an object that a program may see one by one
SPACING_M = 0.005  # of an object's points
WALL_S = 10.0  # beyond the processor time that the process grants itself
ROOT = Path(app.__file__).parent.parent
# -I: no environment, no folder of the caller; -S: no site packages; the package is found by its path alone.
COMMAND = (
    *(sys.executable, "-I", "-S", "-B", "-c"),
    f"import sys; sys.path.insert(0, {str(ROOT)!r}); from app.evaluation.voxposer.program import main; main()",
)


@dataclass(frozen=True, eq=False)
class Scene:
    """The world before the first move.

    Attributes:
        objects: in the world frame.
        radius_m: of the ball about each object's position that stands for its points; 0: the position alone.
        start: the end effector's pose and the gripper's state.
    """

    workspace: Workspace
    objects: tuple[ObjectPose, ...]
    radius_m: float
    start: EndEffectorAction

    @property
    def voxels(self) -> Voxels:
        """The workspace cut into SIZE voxels along each axis."""
        low_m, high_m = self.workspace.min_m, self.workspace.max_m
        return Voxels(tuple(low_m.tolist()), tuple(((high_m - low_m) / SIZE).tolist()))

    def to_json(self) -> dict[str, Any]:
        """As the program's process reads it."""
        hand = ObjectPose("hand", self.start.position_m, self.start.quaternion_xyzw)
        return {
            "min_m": self.voxels.min_m,
            "step_m": self.voxels.step_m,
            "objects": [self._json_of(pose, self.radius_m) for pose in self.objects],
            "hand": self._json_of(hand, 0.0),
        }

    def _json_of(self, pose: ObjectPose, radius_m: float) -> dict[str, Any]:
        points_m = _ball_m(pose, radius_m)
        held = np.unique([self.voxels.at(point) for point in points_m.tolist()], axis=0)
        step = -(-len(held) // MAX_VOXELS)
        return {
            "name": pose.name,
            "position_m": pose.position_m.tolist(),
            "quaternion_xyzw": None if pose.quaternion_xyzw is None else pose.quaternion_xyzw.tolist(),
            "voxels": held[::step].tolist(),
        }


def _ball_m(pose: ObjectPose, radius_m: float) -> Array:
    """(N, 3) points of a ball about the object's position, in a grid along its axes."""
    side = np.linspace(-radius_m, radius_m, int(2 * radius_m / SPACING_M) + 1)
    points_m = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    turn = Rotation.identity() if pose.quaternion_xyzw is None else Rotation.from_quat(pose.quaternion_xyzw)
    inside = points_m[np.linalg.norm(points_m, axis=1) <= radius_m]
    placed_m: Array = turn.apply(inside) + pose.position_m
    return placed_m


def run_program(program: str, scene: Scene) -> list[dict[str, Any]]:
    """The moves that the program asks for: for each, the boxes that it painted in each map. Blocking.

    Raises:
        ProgramRefusedError: if it is not allowed or fails; names the line.
    """
    asked = json.dumps({"program": program, "scene": scene.to_json()})
    try:
        ended = subprocess.run(
            COMMAND,
            input=asked.encode(),
            capture_output=True,
            timeout=WALL_S,
            env={},
            cwd="/",
            check=False,
            start_new_session=True,  # Ctrl-C is for the evaluation to handle
        )
    except subprocess.TimeoutExpired:
        raise ProgramRefusedError(f"the program took more than {WALL_S:g} s") from None
    if ended.returncode != 0:
        raise ProgramRefusedError(f"the program's process ended with {_status(ended.returncode)}")
    answer = json.loads(ended.stdout)
    if "error" in answer:
        raise ProgramRefusedError(answer["error"])
    moves: list[dict[str, Any]] = answer["moves"]
    return moves


def _status(code: int) -> str:
    if code == -signal.SIGXCPU:
        return "too much processor time"
    return signal.Signals(-code).name if code < 0 else f"status {code}"
