"""Names of Python that docstrings and comments put in backticks are there."""

import ast
import re
from collections.abc import Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAME = re.compile(r"(?<!`)`([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)(?:\(\))?`(?!`)")
"""A name, or names joined by dots, in single backticks; other text there is code, a formula or a file."""
FILE_NAME = re.compile(r".*\.(py|yaml|csv|json|html|md|der|pem|npz)")
"""`test_names.py` looks for those of the sources."""
OUTSIDE = {
    "ICC3",
    "PermissionType",
    "Polynomial.fit",
    "asyncua.ua",
    "column.QUANTITY",
    "deriv",
    "earlier_states",
    "effect.parameter",
    "law_of_friction_over_speed",
    "numpy.arange",
    "position_mm",
    "set.NAME",
    "shot10",
    "shot9",
    "ulimit",
    "unit.COLUMN",
    "yaml.safe_load",
}
"""Of other libraries, standards, the shell; magic bytes, a table of a journal, fields of a form, examples."""


def stored(node: ast.AST) -> Iterable[str]:
    """Names that one node of a syntax tree gives to something."""
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            yield node.name
        case ast.arg():
            yield node.arg
        case ast.Name(ctx=ast.Store()):
            yield node.id
        case ast.Attribute(ctx=ast.Store()):
            yield node.attr
        case ast.alias():
            yield from (node.asname or node.name).split(".")
        case ast.keyword(arg=str()):
            yield str(node.arg)
        case ast.Constant(value=str() as text) if text.isidentifier():
            # A key of a file or of a document, an effect, an option.
            yield text


def texts(source: str, nodes: list[ast.AST]) -> Iterable[str]:
    """Docstrings, those below fields and constants too, and comments."""
    for node in nodes:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield str(node.value.value)
    yield from (line.partition("#")[2] for line in source.splitlines() if "#" in line)


class Names:
    """All names of the sources, those of each module and class apart."""

    def __init__(self, sources: dict[Path, str]) -> None:
        self.nodes = {path: list(ast.walk(ast.parse(source))) for path, source in sources.items()}
        self.everywhere: set[str] = set()
        self.modules: dict[str, set[str]] = {}
        self.classes: dict[str, set[str]] = {}
        self.bases: dict[str, list[str]] = {}
        for path, nodes in self.nodes.items():
            names = {name for node in nodes for name in stored(node)}
            self.everywhere |= {*names, *path.with_suffix("").parts}
            self.modules.setdefault(path.stem, set()).update(names)
            for node in nodes:
                if isinstance(node, ast.ClassDef):
                    members = {
                        name for inner in ast.walk(node) if inner is not node for name in stored(inner)
                    }
                    self.classes.setdefault(node.name, set()).update(members)
                    bases = [re.split(r"[\[.]", ast.unparse(base))[0] for base in node.bases]
                    self.bases.setdefault(node.name, []).extend(bases)

    def has_member(self, name: str, member: str) -> bool:
        """Whether a class, or one that it is made from, has it."""
        return member in self.classes.get(name, ()) or any(
            self.has_member(base, member) for base in self.bases.get(name, ()) if base != name
        )

    def resolve(self, dotted: str) -> bool:
        """Whether a name, and what is asked of it after each dot, is there."""
        first, *rest = dotted.split(".")
        if first not in self.everywhere:
            return False
        if not rest:
            return True
        if first in self.classes:
            return self.has_member(first, rest[0])
        if first in self.modules:
            return rest[0] in self.modules[first]
        return self.everywhere.issuperset(rest)


def unresolved(sources: dict[Path, str]) -> list[str]:
    """List the backticked names of the package that name nothing, by file."""
    names = Names(sources)
    return sorted(
        {
            f"{path}: {name}"
            for path, nodes in names.nodes.items()
            if path.parts[0] == "impactcell"
            for text in texts(sources[path], nodes)
            if "`" in text
            for name in NAME.findall(text)
            if not FILE_NAME.fullmatch(name) and name not in OUTSIDE and not names.resolve(name)
        }
    )


@pytest.mark.slow
def test_backticked_names_are_there() -> None:
    sources = {
        path.relative_to(ROOT): path.read_text(encoding="utf-8")
        for package in ("impactcell", "simulator")
        for path in (ROOT / package).rglob("*.py")
    }
    assert len(sources) > 300
    assert unresolved(sources) == []


def test_what_is_gone_is_seen() -> None:
    source = '''"""Uses `Held.kept`, `Held.lost`, `gone`, `held.LIMIT`, `held.NOTHING` and `Held`."""
LIMIT = 3
"""Or `MOST`."""
class Held:
    kept = 1
    def use(self, amount):
        """Takes `amount`, not `sum_of_all`."""  # and never `Other.kept`
'''
    gone = [line.partition(": ")[2] for line in unresolved({Path("impactcell/held.py"): source})]
    assert gone == ["Held.lost", "MOST", "Other.kept", "gone", "held.NOTHING", "sum_of_all"]
