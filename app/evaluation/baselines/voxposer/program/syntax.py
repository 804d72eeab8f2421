"""Which programs are run: Python's grammar, of which a list of constructs is allowed."""

import ast
from types import CodeType

PROGRAM = "program"  # its name in tracebacks
STATEMENTS = (ast.Assign, ast.AugAssign, ast.Expr, ast.For, ast.If, ast.Pass, ast.FunctionDef, ast.Return)
EXPRESSIONS = (
    ast.Constant,
    ast.Name,
    ast.Tuple,
    ast.List,
    ast.BinOp,
    ast.UnaryOp,
    ast.BoolOp,
    ast.Compare,
    ast.IfExp,
    ast.Call,
    ast.Attribute,
    ast.Subscript,
    ast.Slice,
)
OPERATORS = (
    *(ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod),
    *(ast.UAdd, ast.USub, ast.Not, ast.And, ast.Or),
    *(ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.In, ast.NotIn, ast.Is, ast.IsNot),
)
PARTS = (ast.Module, ast.Load, ast.Store, ast.keyword, ast.arguments, ast.arg)
ALLOWED = (*STATEMENTS, *EXPRESSIONS, *OPERATORS, *PARTS)
WHAT_IS_ALLOWED = "assignments, for over a sequence, if, def, return, calls and arithmetic"
# The only way from a value to another object: without further attributes a program has nothing but what it is given.
ATTRIBUTES = ("name", "position", "low", "high", "size_cm", "voxels", "yaw_deg")


class ProgramError(Exception):
    """A program that is refused or fails.

    Args:
        line: of the program, from 1; None if the whole is meant.
    """

    def __init__(self, message: str, line: int | None = None) -> None:
        super().__init__(message if line is None else f"line {line}: {message}")


def compiled(text: str) -> CodeType:
    """The program, if all of it is allowed.

    Raises:
        ProgramError: says where and why it is not.
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
