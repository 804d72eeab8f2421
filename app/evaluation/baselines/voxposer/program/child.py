"""The process itself: one program on standard input, what it asks for on standard output, both as JSON.

It gives up files, network, memory and time before it reads the program.
"""

import json
import resource
import signal
import sys
from collections.abc import Callable, Mapping
from traceback import walk_tb
from typing import Any

from app.evaluation.baselines.voxposer.program.arguments import CommandError
from app.evaluation.baselines.voxposer.program.commands import Commands
from app.evaluation.baselines.voxposer.program.syntax import PROGRAM, ProgramError, compiled

MEMORY_BYTES = 192 * 2**20  # of addresses; Python alone takes about 20 MB of them
CPU_S = 1
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


def answer_to(asked: Mapping[str, Any]) -> dict[str, Any]:
    """The moves of the program, or why there are none."""
    try:
        commands = Commands(asked["scene"])
        run(asked["program"], commands.by_name())
        if not commands.moves:
            raise ProgramError(NO_MOVE)
    except ProgramError as error:
        return {"error": str(error)}
    except RecursionError:
        return {"error": "the program is nested too deeply"}
    except MemoryError:
        return {"error": "the program takes too much memory"}
    return {"moves": commands.moves}


def run(program: str, commands: Mapping[str, Callable[..., object]]) -> None:
    """Carry out the program, which has these commands and no builtins.

    Raises:
        ProgramError: names the line.
    """
    code = compiled(program)
    try:
        exec(code, {"__builtins__": {}, **commands})  # noqa: S102
    except (CommandError, ArithmeticError, AttributeError, LookupError, NameError, TypeError, ValueError) as error:
        lines = [line for frame, line in walk_tb(error.__traceback__) if frame.f_code.co_filename == PROGRAM]
        raise ProgramError(str(error), lines[-1]) from None


def main() -> None:
    """Read, run, answer."""
    asked = json.load(sys.stdin)
    give_up_rights()
    json.dump(answer_to(asked), sys.stdout)


if __name__ == "__main__":
    main()
