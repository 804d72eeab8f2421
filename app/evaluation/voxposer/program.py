"""The sandboxed process of a program: reads the program from standard input, writes its moves to standard output.

It gives up files, network, memory and time. Then it refuses every construct of Python that is not on a list, above all
attributes, by which a program could reach other objects. Only the standard library is imported here.
"""

import ast
import json
import resource
import signal
import sys
from collections.abc import Callable, Mapping
from traceback import walk_tb
from types import CodeType
from typing import Any

from app.evaluation.voxposer.commands import CommandError, Commands

MEMORY_BYTES = 192 * 2**20  # of addresses; Python alone takes about 20 MB of them
CPU_S = 1
NO_MOVE = "the program has no move: it must call move(affordance, ...)"
PROGRAM = "program"  # its name in tracebacks
STATEMENTS = (ast.Assign, ast.AugAssign, ast.Expr, ast.For, ast.If, ast.Pass, ast.FunctionDef, ast.Return)
EXPRESSIONS = (
    *(ast.Constant, ast.Name, ast.Tuple, ast.List, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp),
    *(ast.Call, ast.Attribute, ast.Subscript, ast.Slice),
)
OPERATORS = (
    *(ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod),
    *(ast.UAdd, ast.USub, ast.Not, ast.And, ast.Or),
    *(ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.In, ast.NotIn, ast.Is, ast.IsNot),
)
PARTS = (ast.Module, ast.Load, ast.Store, ast.keyword, ast.arguments, ast.arg)
ALLOWED = (*STATEMENTS, *EXPRESSIONS, *OPERATORS, *PARTS)
WHAT_IS_ALLOWED = "assignments, for over a sequence, if, def, return, calls and arithmetic"
# Without other attributes a program cannot get from its values to other objects.
ATTRIBUTES = ("name", "position", "low", "high", "size_cm", "voxels", "yaw_deg")


class ProgramError(Exception):
    """A program that is refused or fails.

    Args:
        line: of the program, from 1; None if the whole is meant.
    """

    def __init__(self, message: str, line: int | None = None) -> None:
        super().__init__(message if line is None else f"line {line}: {message}")


def main() -> None:
    """Read, run, answer."""
    asked = json.load(sys.stdin)
    give_up_rights()
    json.dump(answer_to(asked), sys.stdout)


def give_up_rights() -> None:
    """Forbid files, sockets and processes, and limit memory and CPU time."""
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
    """Return the moves of the program, or an error."""
    try:
        commands = Commands(asked["scene"])
        _run(compiled(asked["program"]), commands.by_name())
        if not commands.moves:
            raise ProgramError(NO_MOVE)
    except ProgramError as error:
        return {"error": str(error)}
    except RecursionError:
        return {"error": "the program is nested too deeply"}
    except MemoryError:
        return {"error": "the program takes too much memory"}
    return {"moves": commands.moves}


def compiled(text: str) -> CodeType:
    """Return the compiled program.

    Raises:
        ProgramError: if a construct is not allowed; with its line.
    """
    try:
        module = ast.parse(text)
        for node in ast.walk(module):
            _check(node)
        return compile(module, PROGRAM, "exec")
    except SyntaxError as error:
        raise ProgramError(f"is no Python: {error.msg}", error.lineno) from None
    except ValueError as error:
        raise ProgramError(f"the program is no Python: {error}") from None


def _check(node: ast.AST) -> None:
    line = getattr(node, "lineno", None)
    if not isinstance(node, ALLOWED):
        raise ProgramError(f"{type(node).__name__} is not allowed (valid: {WHAT_IS_ALLOWED})", line)
    if isinstance(node, ast.Attribute) and (node.attr not in ATTRIBUTES or isinstance(node.ctx, ast.Store)):
        raise ProgramError(f"the attribute {node.attr!r} is not known (valid: read {', '.join(ATTRIBUTES)})", line)


def _run(code: CodeType, commands: Mapping[str, Callable[..., object]]) -> None:
    """Run a program with these functions and without builtins; an error names its line."""
    try:
        exec(code, {"__builtins__": {}, **commands})  # noqa: S102
    except (CommandError, ArithmeticError, AttributeError, LookupError, NameError, TypeError, ValueError) as error:
        lines = [line for frame, line in walk_tb(error.__traceback__) if frame.f_code.co_filename == PROGRAM]
        raise ProgramError(str(error), lines[-1]) from None
