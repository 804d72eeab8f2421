"""A language model's program, run in a sandboxed process: no files, network or environment, and little time."""

import json
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import app
from app.evaluation.baselines.voxposer.program.voxels import SIZE, Voxels
from app.evaluation.failures import ProgramRefusedError
from app.pipeline.workspace import Workspace
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

MAX_VOXELS = 400  # of an object that a program may see one by one
WALL_S = 10.0  # beyond the processor time that the process grants itself
ROOT = Path(app.__file__).parent.parent
CHILD = "app.evaluation.baselines.voxposer.program.child"
# -I: no environment, no folder of the caller; -S: no site packages; the package is found by its path alone.
COMMAND = (
    *(sys.executable, "-I", "-S", "-B", "-c"),
    f"import sys; sys.path.insert(0, {str(ROOT)!r}); from {CHILD} import main; main()",
)


def voxels_of(workspace: Workspace) -> Voxels:
    """The workspace cut into SIZE voxels along each axis."""
    step_m = (workspace.max_m - workspace.min_m) / SIZE
    return Voxels(tuple(workspace.min_m.tolist()), tuple(step_m.tolist()))


@dataclass(frozen=True, eq=False)
class SeenObject:
    """An object as perception has it.

    Attributes:
        pose: in the world frame.
        points_m: (N, 3) points of it in the world frame, at least one.
    """

    pose: ObjectPose
    points_m: Array


@dataclass(frozen=True, eq=False)
class Scene:
    """The world before the first move.

    Attributes:
        start: the end effector's pose and the gripper's state.
    """

    workspace: Workspace
    objects: tuple[SeenObject, ...]
    start: EndEffectorAction

    def to_json(self) -> dict[str, Any]:
        """As the program's process reads it."""
        voxels = voxels_of(self.workspace)
        start = ObjectPose("hand", self.start.position_m, self.start.quaternion_xyzw)
        return {
            "min_m": voxels.min_m,
            "step_m": voxels.step_m,
            "objects": [_json_of(item.pose, item.points_m, voxels) for item in self.objects],
            "hand": _json_of(start, self.start.position_m[None], voxels),
        }


def _json_of(pose: ObjectPose, points_m: Array, voxels: Voxels) -> dict[str, Any]:
    held = np.unique([voxels.at(point) for point in points_m.tolist()], axis=0)
    step = -(-len(held) // MAX_VOXELS)
    return {
        "name": pose.name,
        "position_m": pose.position_m.tolist(),
        "quaternion_xyzw": None if pose.quaternion_xyzw is None else pose.quaternion_xyzw.tolist(),
        "voxels": held[::step].tolist(),
    }


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
