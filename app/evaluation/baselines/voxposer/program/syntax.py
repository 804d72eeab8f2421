"""Which programs are run: Python's grammar, of which a list of constructs is allowed."""

import ast
import io
import tokenize

MAX_CHARS = 20_000
MAX_NESTING = 40
MAX_NUMBER = 1e9  # numbers beyond it mean nothing in a room, and arithmetic on them could go on forever
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
ATTRIBUTES = ("name", "position", "low", "high", "size_cm", "voxels", "yaw_deg")


class ProgramError(Exception):
    """A program that is refused or fails.

    Args:
        line: of the program, from 1; None if the whole is meant.
    """

    def __init__(self, message: str, line: int | None = None) -> None:
        super().__init__(message if line is None else f"line {line}: {message}")


def parsed(text: str) -> ast.Module:
    """The program, if all of it is allowed.

    Raises:
        ProgramError: says where and why it is not.
    """
    if len(text) > MAX_CHARS:
        raise ProgramError(f"the program has {len(text)} characters (valid: at most {MAX_CHARS})")
    try:
        _check_names(text)
        module = ast.parse(text)
    except (SyntaxError, tokenize.TokenError, ValueError) as error:
        raise _unreadable(error) from None
    except (RecursionError, MemoryError):
        raise ProgramError(f"the program is nested too deeply (valid: at most {MAX_NESTING} levels)") from None
    if not module.body:
        raise ProgramError("the program is empty (valid: statements that call move(...))")
    _check(module)
    return module


def _unreadable(error: Exception) -> ProgramError:
    if isinstance(error, SyntaxError):
        return ProgramError(f"is no Python: {error.msg}", error.lineno)
    return ProgramError(f"the program is no Python: {error.args[0]}")


def _check_names(text: str) -> None:
    """Python takes letters that look alike for the same name; here a name is written in ASCII or not at all."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in (tokenize.NAME, tokenize.ERRORTOKEN) and not token.string.isascii():
            raise ProgramError(f"{token.string!r} has letters beyond ASCII (valid: a to z, digits, _)", token.start[0])


def _check(module: ast.Module) -> None:
    waiting: list[tuple[ast.AST, int, int]] = [(module, 0, 1)]
    while waiting:
        node, depth, line = waiting.pop()
        line = getattr(node, "lineno", line)
        if depth > MAX_NESTING:
            raise ProgramError(f"is nested too deeply (valid: at most {MAX_NESTING} levels)", line)
        _check_node(node, line)
        waiting += [(child, depth + 1, line) for child in ast.iter_child_nodes(node)]


def _check_node(node: ast.AST, line: int) -> None:
    if not isinstance(node, ALLOWED):
        raise ProgramError(f"{type(node).__name__} is not allowed (valid: {WHAT_IS_ALLOWED})", line)
    if isinstance(node, ast.Attribute) and (node.attr not in ATTRIBUTES or isinstance(node.ctx, ast.Store)):
        raise ProgramError(f"the attribute {node.attr!r} is not known (valid: read {', '.join(ATTRIBUTES)})", line)
    if isinstance(node, ast.Constant):
        _check_constant(node.value, line)
    if isinstance(node, ast.FunctionDef):
        _check_function(node, line)
    if isinstance(node, ast.For) and node.orelse:
        raise ProgramError("for ... else is not allowed", line)


def _check_constant(value: object, line: int) -> None:
    if not isinstance(value, bool | int | float | str | None):
        raise ProgramError(f"{value!r:.40} is not allowed (valid: numbers, texts, True, False, None)", line)
    if isinstance(value, int | float) and not abs(value) <= MAX_NUMBER:
        raise ProgramError(f"a number is beyond {MAX_NUMBER:g}", line)


def _check_function(node: ast.FunctionDef, line: int) -> None:
    given = node.args
    plain = not (given.posonlyargs or given.vararg or given.kwonlyargs or given.kwarg or given.defaults)
    if not plain or node.decorator_list or node.returns or any(arg.annotation for arg in given.args):
        raise ProgramError("def takes plain parameters only, without defaults, * or decorators", line)
