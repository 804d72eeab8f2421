"""Runs a language model's program in a process of its own, without files, network, environment or much time."""

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import app
from app.voxposer.errors import ProgramRefusedError
from app.voxposer.scene import Scene

WALL_S = 10.0  # beyond the processor time that the process grants itself
ROOT = Path(app.__file__).parent.parent
# -I: no environment, no folder of the caller; -S: no site packages; the package is found by its path alone.
COMMAND = (
    *(sys.executable, "-I", "-S", "-B", "-c"),
    f"import sys; sys.path.insert(0, {str(ROOT)!r}); from app.voxposer.program.child import main; main()",
)


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
            start_new_session=True,  # Ctrl-C is for the service to handle
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
