"""What the syntax trees of a room say: classes, constants, arguments, branches."""

import ast
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, slots=True)
class Module:
    """One parsed file; `name` is its path from the root of the tree, without suffix, with dots."""

    name: str
    path: Path
    lines: tuple[str, ...]
    tree: ast.Module
    nodes: tuple[ast.AST, ...]  # of the tree, walked once


def modules(root: Path, package: str) -> list[Module]:
    """Parse every file of a package below `root`, by name."""
    parsed = []
    for path in sorted((root / package).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        name = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
        tree = ast.parse(text)
        parsed.append(Module(name, path, tuple(text.splitlines()), tree, tuple(ast.walk(tree))))
    return parsed


def classes(module: Module) -> Iterator[ast.ClassDef]:
    """Give every class of a module."""
    return (node for node in module.nodes if isinstance(node, ast.ClassDef))


def functions(module: Module) -> Iterator[Function]:
    """Give every function and method of a module."""
    return (node for node in module.nodes if isinstance(node, Function))


def dataclass_homes(parsed: list[Module]) -> Mapping[str, list[str]]:
    """Tell in which modules a dataclass of each name is defined."""
    homes = defaultdict(list)
    for module in parsed:
        for node in classes(module):
            if any("dataclass" in ast.unparse(decorator) for decorator in node.decorator_list):
                homes[node.name].append(module.name)
    return homes


def arguments(function: Function) -> int:
    """Count what a caller may pass, `self` and `cls` aside."""
    given = function.args
    names = [argument.arg for argument in (*given.posonlyargs, *given.args)]
    return len(names) + len(given.kwonlyargs) - (names[:1] in (["self"], ["cls"]))


def complexity(function: Function) -> int:
    """Cyclomatic complexity after McCabe: one, and one for each branch, loop, handler and `and` or `or`."""
    count = 1
    branches = (ast.If, ast.For, ast.AsyncFor, ast.While, ast.ExceptHandler, ast.IfExp, ast.comprehension)
    for node in ast.walk(function):
        if isinstance(node, (*branches, ast.match_case)):
            count += 1
        elif isinstance(node, ast.BoolOp):
            count += len(node.values) - 1
    return count


def called(function: Function) -> set[str]:
    """Give the bare names of all that a function calls."""
    calls = (node.func for node in ast.walk(function) if isinstance(node, ast.Call))
    return {
        callee.id if isinstance(callee, ast.Name) else callee.attr
        for callee in calls
        if isinstance(callee, (ast.Name, ast.Attribute))
    }


def _has_number(node: ast.expr) -> bool:
    if any(isinstance(part, ast.Lambda) for part in ast.walk(node)):
        return False
    return any(
        isinstance(part, ast.Constant)
        and isinstance(part.value, int | float)
        and not isinstance(part.value, bool)
        for part in ast.walk(node)
    )


def bare_constants(module: Module) -> tuple[list[str], int]:
    """Give the numeric constants of a module without a word about them, and how many there are in all.

    A word is a docstring after the assignment, or a comment on its last line or the line above it.
    """
    bare, count = [], 0
    body = module.tree.body
    for place, node in enumerate(body):
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        if not _has_number(node.value):
            continue
        count += 1
        after = body[place + 1] if place + 1 < len(body) else None
        documented = (
            isinstance(after, ast.Expr)
            and isinstance(after.value, ast.Constant)
            and isinstance(after.value.value, str)
        )
        last, above = module.lines[(node.end_lineno or node.lineno) - 1], module.lines[node.lineno - 2]
        commented = "#" in last.rsplit('"', 1)[-1] or (node.lineno > 1 and above.lstrip().startswith("#"))
        if not documented and not commented:
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            bare.append(f"{module.name}:{node.lineno} {ast.unparse(target)}")
    return bare, count
