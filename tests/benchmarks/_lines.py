"""What the lines of a room are: code, docstrings, comments, blank."""

import ast
import io
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from tests.benchmarks import _syntax

KINDS: Final = ("code", "docstrings", "comments", "blank")


def kinds(module: _syntax.Module) -> Counter[str]:
    """Count the lines of a module by kind; a line of code that ends in a comment is one of code.

    A docstring is any string that stands alone as a statement, those below fields and constants too; a blank
    line inside of one belongs to it.
    """
    documented = set(_documented(module.nodes))
    signed = {number for number, line in enumerate(module.lines, 1) if line.lstrip().startswith("#")}
    commented = signed & _commented(module.lines) if signed - documented else set()
    counts = Counter[str]()
    for number, line in enumerate(module.lines, 1):
        if number in documented:
            counts["docstrings"] += 1
        elif not line.strip():
            counts["blank"] += 1
        elif number in commented:
            counts["comments"] += 1
        else:
            counts["code"] += 1
    return counts


def _commented(lines: Sequence[str]) -> set[int]:
    tokens = tokenize.generate_tokens(io.StringIO("\n".join(lines) + "\n").readline)
    return {token.start[0] for token in tokens if token.type == tokenize.COMMENT}


def _documented(nodes: Iterable[ast.AST]) -> Iterator[int]:
    alone = (node.value for node in nodes if isinstance(node, ast.Expr))
    for node in alone:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from range(node.lineno, (node.end_lineno or node.lineno) + 1)


def by_room(parsed: Iterable[_syntax.Module]) -> dict[str, Counter[str]]:
    """Count the lines of every room by kind, the largest room first."""
    rooms: dict[str, Counter[str]] = {}
    for module in parsed:
        _, *below = module.name.split(".")
        is_room = len(below) > 1 or module.path.name == "__init__.py"
        room = below[0] if below and is_room else "at the top"
        rooms.setdefault(room, Counter()).update(kinds(module))
    return dict(sorted(rooms.items(), key=lambda entry: -entry[1].total()))


def rows(rooms: dict[str, Counter[str]]) -> Sequence[tuple[str, ...]]:
    """Write the counts as rows, with a row of all rooms at the end."""
    everything = sum(rooms.values(), Counter[str]())
    return [
        (room, *(str(counts[kind]) for kind in KINDS), str(counts.total()))
        for room, counts in (*rooms.items(), ("all", everything))
    ]
