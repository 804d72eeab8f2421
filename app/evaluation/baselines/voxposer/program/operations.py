"""Arithmetic, comparisons and sequences as programs have them, each within bounds."""

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from app.evaluation.baselines.voxposer.program.syntax import MAX_NUMBER

MAX_ITEMS = 10_000  # of a sequence
SCALARS = (bool, int, float, str, type(None))
ARITHMETIC: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
}
COMPARISONS: Mapping[type[ast.AST], Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
    ast.In: lambda item, items: item in items,
    ast.NotIn: lambda item, items: item not in items,
}


class CommandError(Exception):
    """A command that cannot be carried out as it was called."""


def number(value: object) -> Any:  # noqa: ANN401
    """`value`, if it is a number; raises CommandError."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise CommandError("arithmetic takes numbers only")
    return value


def computed(kind: type[ast.AST], left: object, right: object) -> object:
    """The result of a binary operator; raises CommandError for what is no number, or too large a one."""
    result = ARITHMETIC[kind](number(left), number(right))
    if not abs(result) <= MAX_NUMBER:
        raise CommandError(f"a number is beyond {MAX_NUMBER:g}")
    return result


def scalar(value: object) -> Any:  # noqa: ANN401
    """`value`, if it can be compared at once; raises CommandError."""
    if not isinstance(value, SCALARS):
        raise CommandError("only numbers and texts can be compared")
    return value


def comparable(comparison: ast.cmpop, value: object) -> Any:  # noqa: ANN401
    """The right side of a comparison; raises CommandError."""
    if isinstance(comparison, ast.In | ast.NotIn) and not isinstance(value, str):
        return [scalar(item) for item in items(value)]
    return scalar(value)


def items(value: object) -> Sequence[object]:
    """`value`, if it is a sequence of bounded length; raises CommandError."""
    if not isinstance(value, list | tuple | range):
        raise CommandError("is no sequence")
    if len(value) > MAX_ITEMS:
        raise CommandError(f"a sequence has {len(value)} items (valid: at most {MAX_ITEMS})")
    return value
