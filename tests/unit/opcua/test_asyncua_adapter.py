"""What lies inside asyncua is used through one module, and asyncua is bounded to what was tested."""

import ast
import tomllib
from pathlib import Path

import asyncua
import pytest
from packaging.requirements import Requirement

import impactcell

PRODUCT = Path(impactcell.__file__).parent
ADAPTER = PRODUCT / "opcua" / "asyncua_adapter.py"
INSIDE_UA = {"ua_binary", "uaprotocol_auto", "uaprotocol_hand", "uatypes"}
"""Modules of asyncua that are reached through its public `ua` too."""
INSIDE_SERVER = {"iserver", "aspace", "value_callback"}
"""Attributes of asyncua's server and nodes that it does not document."""


def insides(source: str) -> list[str]:
    """List what a module uses of asyncua beside `from asyncua import ua`."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "asyncua":
            found += [
                f"{node.module}.{a.name}" for a in node.names if (node.module, a.name) != ("asyncua", "ua")
            ]
        elif isinstance(node, ast.Import):
            found += [a.name for a in node.names if a.name.split(".")[0] == "asyncua"]
        elif isinstance(node, ast.Attribute) and node.attr in INSIDE_UA | INSIDE_SERVER:
            found.append(node.attr)
    return found


@pytest.mark.slow
def test_no_other_module_looks_inside_asyncua() -> None:
    modules = sorted(set(PRODUCT.rglob("*.py")) - {ADAPTER})
    found = {str(path.relative_to(PRODUCT)): insides(path.read_text()) for path in modules}
    assert {path: uses for path, uses in found.items() if uses} == {}
    assert len(modules) > 100


@pytest.mark.parametrize(
    "source",
    [
        "from asyncua.ua.ua_binary import struct_to_binary",
        "from asyncua import Server",
        "import asyncua.server.server",
        "from asyncua import ua\nua.ua_binary.struct_to_binary(1)",
        "server.iserver.aspace",
    ],
)
def test_a_look_inside_is_found(source: str) -> None:
    assert insides(source)


def test_asyncua_is_bounded_to_the_tested_minor_version() -> None:
    project = tomllib.loads((PRODUCT.parent / "pyproject.toml").read_text())["project"]
    requirement = next(r for r in map(Requirement, project["dependencies"]) if r.name == "asyncua")
    major, minor = map(int, asyncua.__version__.split(".")[:2])
    assert requirement.specifier.contains(asyncua.__version__)
    assert not requirement.specifier.contains(f"{major}.{minor + 1}.0")
