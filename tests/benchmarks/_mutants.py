"""Single faults of a Python module: a comparison, sign, constant, condition or call that is another."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

_COMPARISONS: Final = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
_OPERATORS: Final = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Add,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
_WORDS_ONLY: Final = ("log", "logging", "warning", "debug", "info", "error", "exception", "format")
"""Calls that only say something."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One fault: the text from `start` to `end` of the source becomes `text`."""

    line: int
    start: int
    end: int
    before: str
    text: str

    def applied(self, source: str) -> str:
        """Give the source with the fault."""
        return source[: self.start] + self.text + source[self.end :]


def mutants(source: str) -> list[Mutant]:
    """List all single faults of a source, in their order."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    lines = source.splitlines(keepends=True)

    def place(line: int, column: int) -> int:
        return starts[line - 1] + len(lines[line - 1].encode()[:column].decode())

    found = []
    for node, new in _changes(ast.parse(source)):
        start = place(node.lineno, node.col_offset)
        end = place(node.end_lineno or node.lineno, node.end_col_offset or 0)
        text = new if isinstance(new, str) else f"({ast.unparse(new)})"
        found.append(Mutant(node.lineno, start, end, source[start:end], text))
    return found


def _changes(tree: ast.AST) -> Iterator[tuple[ast.expr | ast.stmt, ast.expr | str]]:
    for node in _behaving(tree):
        match node:
            case ast.Compare(left, [operator], right) if type(operator) in _COMPARISONS:
                yield node, ast.Compare(left, [_COMPARISONS[type(operator)]()], right)
            case ast.BinOp(left, operator, right) if type(operator) in _OPERATORS:
                yield node, ast.BinOp(left, _OPERATORS[type(operator)](), right)
            case ast.BoolOp(operator, values):
                other = ast.Or() if isinstance(operator, ast.And) else ast.And()
                yield node, ast.BoolOp(other, values)
            case ast.UnaryOp(ast.Not(), operand):
                yield node, operand
            case ast.Constant(bool(value)):
                yield node, ast.Constant(not value)
            case ast.Constant(int(value) | float(value)):
                yield node, ast.Constant(value + 1)
            case ast.If(test) | ast.While(test) | ast.IfExp(test) if not isinstance(test, ast.Constant):
                yield test, ast.UnaryOp(ast.Not(), test)
            case ast.Expr(ast.Call() | ast.Await()):
                yield node, "pass"
            case ast.Return(value) if value is not None and not isinstance(value, ast.Constant):
                yield value, ast.Constant(None)


def _behaving(tree: ast.AST) -> Iterator[ast.AST]:
    """Walk through what a program does: no annotations, no texts, nothing that only says something."""
    for name, value in ast.iter_fields(tree):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for node in value if isinstance(value, list) else [value]:
            if not isinstance(node, ast.AST) or isinstance(node, ast.JoinedStr | ast.Raise | ast.Import):
                continue
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
                function = node.value.func
                if isinstance(function, ast.Attribute) and function.attr in _WORDS_ONLY:
                    continue
            yield node
            yield from _behaving(node)
