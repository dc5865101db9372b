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
_NO_EFFECT: Final = ("strict", "stacklevel", "maxsize")
"""Arguments of `zip`, warnings and caches that change nothing of what comes out."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One fault: the text from `start` to `end` of the source becomes `text`.

    Attributes
    ----------
    function : str
        Qualified name of the function that it is in; empty at the level of the module or of a class.
    """

    function: str
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

    every = []
    for function, node in _behaving(ast.parse(source)):
        for changed, new in _changes(node):
            start = place(changed.lineno, changed.col_offset)
            end = place(changed.end_lineno or changed.lineno, changed.end_col_offset or 0)
            text = new if isinstance(new, str) else f"({ast.unparse(new)})"
            every.append(Mutant(function, changed.lineno, start, end, source[start:end], text))
    return every


def _changes(node: ast.AST) -> Iterator[tuple[ast.expr | ast.stmt, ast.expr | str]]:
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
        case ast.If(test) | ast.While(test) | ast.IfExp(test) if not _is_changed_itself(test):
            yield test, ast.UnaryOp(ast.Not(), test)
        case ast.Expr(ast.Call() | ast.Await()):
            yield node, "pass"
        case ast.Return(value) if value is not None and not isinstance(value, ast.Constant):
            yield value, ast.Constant(None)


def _is_changed_itself(test: ast.expr) -> bool:
    """Whether the negation of a condition is a mutant of its own already, or says nothing."""
    match test:
        case ast.Constant() | ast.UnaryOp(ast.Not()):
            return True
        case ast.Compare(_, [ast.Eq() | ast.NotEq() | ast.Is() | ast.IsNot() | ast.In() | ast.NotIn()]):
            return True
    return False


def _behaving(tree: ast.AST, function: str = "", within: str = "") -> Iterator[tuple[str, ast.AST]]:
    """Walk through what a program does: no annotations, no texts, nothing that only says something."""
    for name, value in ast.iter_fields(tree):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for node in value if isinstance(value, list) else [value]:
            if not isinstance(node, ast.AST) or isinstance(node, ast.JoinedStr | ast.Raise | ast.Import):
                continue
            if isinstance(node, ast.keyword) and node.arg in _NO_EFFECT:
                continue
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
                called = node.value.func
                if isinstance(called, ast.Attribute) and called.attr in _WORDS_ONLY:
                    continue
            yield function, node
            match node:
                case ast.FunctionDef(name=own) | ast.AsyncFunctionDef(name=own):
                    yield from _behaving(node, within + own, f"{within}{own}.<locals>.")
                case ast.ClassDef(name=own):
                    yield from _behaving(node, function, f"{within}{own}.")
                case _:
                    yield from _behaving(node, function, within)


def compiled_with(source: str, line: int) -> frozenset[str]:
    """Name of the compiled function, or of the constant of the module, that a line of a source is in.

    Empty for a line of which no machine code is made.
    """
    for node in ast.parse(source).body:
        if node.lineno <= line <= (node.end_lineno or node.lineno):
            match node:
                case ast.FunctionDef(name, decorator_list=decorators):
                    if any("compiled" in ast.unparse(decorator) for decorator in decorators):
                        return frozenset({name})
                case ast.Assign(targets):
                    return frozenset(t.id for t in targets if isinstance(t, ast.Name))
                case ast.AnnAssign(ast.Name(name)):
                    return frozenset({name})
    return frozenset()


Named = tuple[str, str]
"""Stem of a file, and a name in it."""


def users_of(names: frozenset[Named], sources: list[tuple[str, str]]) -> frozenset[Named]:
    """Name all functions that use one of `names`, or a function that does, and so on.

    `sources` are stems and texts of files; a function is used by its own name, or as `module.name`.
    """
    uses = [use for stem, text in sources for use in _uses(stem, ast.parse(text))]
    while names < (more := names | {user for user, used in uses if used & names}):
        names = more
    return names


def _uses(stem: str, tree: ast.Module) -> Iterator[tuple[Named, set[Named]]]:
    """Name each function of a file, and what it uses."""
    imported = {
        alias.asname or alias.name: (node.module.split(".")[-1], alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        used: set[Named] = set()
        for node in ast.walk(function):
            match node:
                case ast.Name(name) | ast.arg(name):
                    used.add(imported.get(name, (stem, name)))
                case ast.Attribute(ast.Name(module), name):
                    used.add((imported[module][1] if module in imported else module, name))
        yield (stem, function.name), used
