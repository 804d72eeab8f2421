"""Carries out a parsed program by walking its tree; Python's own interpreter never sees it.

Values are numbers, texts, sequences, and what `commands` hands out. There is nothing from which a program could get
hold of an object of the process.
"""

import ast
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from app.evaluation.baselines.voxposer.program.operations import (
    COMPARISONS,
    CommandError,
    comparable,
    computed,
    items,
    number,
    scalar,
)
from app.evaluation.baselines.voxposer.program.syntax import ATTRIBUTES, ProgramError

MAX_STEPS = 100_000
MAX_CALLS = 16  # of the program's functions within each other


class Returned(Exception):  # noqa: N818 - no error: how a function of the program ends
    """A function of the program returns.

    Args:
        value: to the caller.
    """

    def __init__(self, value: object) -> None:
        super().__init__()
        self.value = value


class Target:
    """What a program may write into by an index."""

    def paint(self, index: object, value: object) -> None:
        """Set the items at `index`; raises CommandError."""
        raise NotImplementedError


class Readable:
    """What a program may read `syntax.ATTRIBUTES` of."""


class Interpreter:
    """Runs one program.

    Args:
        commands: what it may call, by name.
    """

    def __init__(self, commands: Mapping[str, Callable[..., object]]) -> None:
        self._commands = commands
        self._functions: dict[str, ast.FunctionDef] = {}
        self._scopes: list[dict[str, object]] = [{}]
        self._steps = 0
        self._line = 1

    def run(self, module: ast.Module) -> None:
        """Carry out all of it.

        Raises:
            ProgramError: names the line.
        """
        try:
            self._block(module.body)
        except Returned:
            raise ProgramError("return stands outside of a function", self._line) from None
        except (CommandError, TypeError, ValueError, ArithmeticError, IndexError) as error:
            raise ProgramError(str(error), self._line) from None

    def _block(self, statements: Sequence[ast.stmt]) -> None:
        for statement in statements:
            self._step(statement)
            STATEMENTS[type(statement)](self, statement)

    def _step(self, node: ast.AST) -> None:
        self._steps += 1
        self._line = getattr(node, "lineno", self._line)
        if self._steps > MAX_STEPS:
            raise ProgramError(f"the program takes more than {MAX_STEPS} steps", self._line)

    def _value(self, node: ast.expr) -> Any:  # noqa: ANN401
        self._step(node)
        return EXPRESSIONS[type(node)](self, node)

    def _assign(self, node: ast.Assign) -> None:
        value = self._value(node.value)
        for target in node.targets:
            self._bind(target, value)

    def _aug_assign(self, node: ast.AugAssign) -> None:
        if not isinstance(node.target, ast.Name):
            raise CommandError("only a name can be changed by += and its like")
        before = self._name(ast.Name(node.target.id, ast.Load()))
        self._bind(node.target, computed(type(node.op), before, self._value(node.value)))

    def _bind(self, target: ast.expr, value: object) -> None:
        if isinstance(target, ast.Name):
            if target.id in self._commands or target.id in self._functions:
                raise CommandError(f"{target.id} is a function and cannot be assigned to")
            self._scopes[-1][target.id] = value
        elif isinstance(target, ast.Tuple | ast.List):
            values = items(value)
            if len(values) != len(target.elts):
                raise CommandError(f"{len(values)} values cannot be given to {len(target.elts)} names")
            for part, item in zip(target.elts, values, strict=True):
                self._bind(part, item)
        elif isinstance(target, ast.Subscript):
            self._paint(target, value)
        else:
            raise CommandError("only names and maps can be assigned to")

    def _paint(self, target: ast.Subscript, value: object) -> None:
        written = self._value(target.value)
        if not isinstance(written, Target):
            raise CommandError("only a map can be written into by an index")
        written.paint(self._value(target.slice), value)

    def _for(self, node: ast.For) -> None:
        for item in items(self._value(node.iter)):
            self._step(node)
            self._bind(node.target, item)
            self._block(node.body)

    def _if(self, node: ast.If) -> None:
        self._block(node.body if self._value(node.test) else node.orelse)

    def _def(self, node: ast.FunctionDef) -> None:
        if node.name in self._commands:
            raise CommandError(f"{node.name} is a function already and cannot be replaced")
        self._functions[node.name] = node

    def _return(self, node: ast.Return) -> None:
        raise Returned(None if node.value is None else self._value(node.value))

    def _name(self, node: ast.Name) -> object:
        for scope in (self._scopes[-1], self._scopes[0]):
            if node.id in scope:
                return scope[node.id]
        known = "is a function: call it" if node.id in {*self._commands, *self._functions} else "is not known"
        raise CommandError(f"the name {node.id!r} {known} (functions: {', '.join(self._commands)})")

    def _call(self, node: ast.Call) -> object:
        name = self._function_name(node)
        arguments = [self._value(argument) for argument in node.args]
        named = {self._keyword(keyword): self._value(keyword.value) for keyword in node.keywords}
        self._line = node.lineno
        if name in self._functions:
            return self._call_function(self._functions[name], arguments, named)
        try:
            return self._commands[name](*arguments, **named)
        except TypeError:
            names = ", ".join(inspect.signature(self._commands[name]).parameters)
            raise CommandError(f"{name} takes {names or 'no arguments'}") from None

    def _function_name(self, node: ast.Call) -> str:
        if not isinstance(node.func, ast.Name):
            raise CommandError("only functions with a name can be called")
        if node.func.id not in (known := [*self._commands, *self._functions]):
            raise CommandError(f"the function {node.func.id!r} is not known (valid: {', '.join(known)})")
        return node.func.id

    def _keyword(self, keyword: ast.keyword) -> str:
        if keyword.arg is None:
            raise CommandError("** is not allowed in calls")
        return keyword.arg

    def _call_function(self, function: ast.FunctionDef, arguments: list[object], named: dict[str, object]) -> object:
        names = [arg.arg for arg in function.args.args]
        local = dict(zip(names, arguments, strict=False)) | named
        if len(arguments) > len(names) or sorted(local) != sorted(names):
            raise CommandError(f"{function.name} takes {', '.join(names) or 'no arguments'}")
        if len(self._scopes) > MAX_CALLS:
            raise ProgramError(f"functions call each other more than {MAX_CALLS} deep", self._line)
        self._scopes.append(local)
        try:
            self._block(function.body)
        except Returned as returned:
            return returned.value
        finally:
            self._scopes.pop()
        return None

    def _attribute(self, node: ast.Attribute) -> object:
        owner = self._value(node.value)
        if not isinstance(owner, Readable) or node.attr not in ATTRIBUTES:
            raise CommandError(f"only what detect gives has {node.attr!r}")
        return getattr(owner, node.attr)

    def _subscript(self, node: ast.Subscript) -> object:
        sequence, index = self._value(node.value), self._value(node.slice)
        if not isinstance(sequence, list | tuple | range):
            raise CommandError("only sequences can be read by an index; maps are written, not read")
        if not isinstance(index, int | slice):
            raise CommandError("the index of a sequence is a whole number")
        return sequence[index]

    def _slice(self, node: ast.Slice) -> slice:
        ends = [None if end is None else self._value(end) for end in (node.lower, node.upper, node.step)]
        if not all(end is None or isinstance(end, int) for end in ends):
            raise CommandError("the ends of a slice are whole numbers")
        return slice(*ends)

    def _tuple(self, node: ast.Tuple | ast.List) -> tuple[object, ...]:
        return tuple(self._value(item) for item in node.elts)

    def _binary(self, node: ast.BinOp) -> object:
        return computed(type(node.op), self._value(node.left), self._value(node.right))

    def _unary(self, node: ast.UnaryOp) -> object:
        value = self._value(node.operand)
        if isinstance(node.op, ast.Not):
            return not value
        return -number(value) if isinstance(node.op, ast.USub) else number(value)

    def _bool(self, node: ast.BoolOp) -> object:
        stops_at = isinstance(node.op, ast.Or)
        value: object = None
        for part in node.values:
            value = self._value(part)
            if bool(value) is stops_at:
                return value
        return value

    def _compare(self, node: ast.Compare) -> bool:
        left = self._value(node.left)
        for comparison, part in zip(node.ops, node.comparators, strict=True):
            right = self._value(part)
            if not COMPARISONS[type(comparison)](scalar(left), comparable(comparison, right)):
                return False
            left = right
        return True

    def _if_expression(self, node: ast.IfExp) -> object:
        return self._value(node.body if self._value(node.test) else node.orelse)


_Node = Any
STATEMENTS: Mapping[type[ast.stmt], Callable[[Interpreter, _Node], None]] = {
    ast.Assign: Interpreter._assign,
    ast.AugAssign: Interpreter._aug_assign,
    ast.Expr: lambda self, node: self._value(node.value),
    ast.For: Interpreter._for,
    ast.If: Interpreter._if,
    ast.Pass: lambda self, node: None,
    ast.FunctionDef: Interpreter._def,
    ast.Return: Interpreter._return,
}
EXPRESSIONS: Mapping[type[ast.expr], Callable[[Interpreter, _Node], object]] = {
    ast.Constant: lambda self, node: node.value,
    ast.Name: Interpreter._name,
    ast.Tuple: Interpreter._tuple,
    ast.List: Interpreter._tuple,
    ast.BinOp: Interpreter._binary,
    ast.UnaryOp: Interpreter._unary,
    ast.BoolOp: Interpreter._bool,
    ast.Compare: Interpreter._compare,
    ast.IfExp: Interpreter._if_expression,
    ast.Call: Interpreter._call,
    ast.Attribute: Interpreter._attribute,
    ast.Subscript: Interpreter._subscript,
    ast.Slice: Interpreter._slice,
}
