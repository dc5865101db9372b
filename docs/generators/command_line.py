"""Every verb with its arguments and options, as the command line itself declares them."""

from collections.abc import Iterator
from typing import Any

import typer.main

from generators.markdown import code, table
from impactcell.cli.app import app


def _verbs(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    children = getattr(command, "commands", None)
    if children is None:
        yield name, command
        return
    for child, below in children.items():
        yield from _verbs(below, f"{name} {child}")


def _parameter(parameter: Any) -> tuple[str, str, str]:
    value = parameter.metavar or parameter.name.upper()
    if parameter.param_type_name == "argument":
        name = value + (" ..." if parameter.nargs == -1 else "")
        name = name if parameter.required else f"[{name}]"
    else:
        name = ", ".join(parameter.opts) + ("" if parameter.is_flag else f" {value}")
    default = parameter.default
    shown = "" if default is None or default is False or callable(default) else str(default)
    return code(name), parameter.help or "", code(shown)


def verbs() -> str:
    """Write one section a verb."""
    parts = []
    for name, command in _verbs(typer.main.get_command(app), "impactcell"):
        rows = [_parameter(parameter) for parameter in command.params if parameter.name != "help"]
        about = (command.help or "").split("\n\n")[0]
        parts += [f"## {name}", about, table(("argument or option", "meaning", "default"), rows)]
    return "\n\n".join(parts)
