"""Every module of every room, with the first line of its docstring."""

import ast
from pathlib import Path

from generators.markdown import code, table

ROOT = Path(__file__).resolve().parents[2]


def _summary(path: Path) -> str:
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return text.split("\n\n")[0].replace("<", "\\<").replace("*", "\\*").replace("_", "\\_")


def _rows(directory: Path) -> list[tuple[str, str]]:
    files = sorted(path for path in directory.rglob("*.py") if path.name != "__init__.py")
    return [
        (code(str(path.relative_to(directory).with_suffix(""))), _summary(path))
        for path in files
        if "effects" not in path.relative_to(directory).parts[:1]
    ]


def tables() -> str:
    """Write one section a room."""
    package = ROOT / "impactcell"
    rooms = sorted(path.parent for path in package.glob("*/__init__.py"))
    top = [(code(name), _summary(package / f"{name}.py")) for name in ("errors", "quantities")]
    parts = ["## impactcell", _summary(package / "__init__.py"), table(("module", "what is in it"), top)]
    for room in [*rooms, ROOT / "simulator"]:
        parts += [
            f"## {room.name}",
            _summary(room / "__init__.py"),
            table(("module", "what is in it"), _rows(room)),
        ]
    return "\n\n".join(parts)
