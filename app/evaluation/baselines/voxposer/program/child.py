"""The process itself: one program on standard input, what it asks for on standard output, both as JSON.

It gives up files, network, memory and time before it reads the program.
"""

import json
import resource
import signal
import sys
from collections.abc import Mapping
from typing import Any

from app.evaluation.baselines.voxposer.program.commands import Commands
from app.evaluation.baselines.voxposer.program.interpreter import Interpreter
from app.evaluation.baselines.voxposer.program.syntax import ProgramError, parsed

MEMORY_BYTES = 192 * 2**20  # of addresses; Python alone takes about 20 MB of them
CPU_S = 3
FRAMES = 20_000  # of Python's stack, more than nested expressions in nested functions take
NO_MOVE = "the program has no move: it must call move(affordance, ...)"


def give_up_rights() -> None:
    """Let the process open, write and start nothing, and end it when it takes too much."""
    signal.signal(signal.SIGXCPU, signal.SIG_DFL)
    limits = {
        resource.RLIMIT_AS: MEMORY_BYTES,
        resource.RLIMIT_NOFILE: 3,  # no more than the three that are open: no file, no socket, no pipe
        resource.RLIMIT_FSIZE: 0,
        resource.RLIMIT_NPROC: 0,
        resource.RLIMIT_CORE: 0,
    }
    for limit, most in limits.items():
        resource.setrlimit(limit, (most, most))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 1))  # the second limit cannot be caught
    sys.setrecursionlimit(FRAMES)


def answer_to(asked: Mapping[str, Any]) -> dict[str, Any]:
    """The moves of the program, or why there are none."""
    try:
        commands = Commands(asked["scene"])
        Interpreter(commands.by_name()).run(parsed(asked["program"]))
        if not commands.moves:
            raise ProgramError(NO_MOVE)
    except ProgramError as error:
        return {"error": str(error)}
    except RecursionError:
        return {"error": "the program is nested too deeply"}
    except MemoryError:
        return {"error": "the program takes too much memory"}
    return {"moves": commands.moves}


def main() -> None:
    """Read, run, answer."""
    asked = json.load(sys.stdin)
    give_up_rights()
    json.dump(answer_to(asked), sys.stdout)


if __name__ == "__main__":
    main()
