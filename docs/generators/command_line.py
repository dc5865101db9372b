"""Every verb with its arguments and options, as the command lines themselves declare them."""

import argparse
import re
from collections.abc import Iterator
from typing import Any

import typer.main

from generators.markdown import code, table
from impactcell.cli.app import app
from impactcell.process.exit_codes import ExitCode
from simulator.__main__ import _parser

EXIT_CODES = {
    ExitCode.DONE: "done",
    ExitCode.FAILED: "failed while working: no answer of a module, a journal, a fit that is not possible",
    ExitCode.BAD_INPUT: "bad input: an option, a cell file, map, model, campaign, series, measurement or "
    "effect, certificate or file of users, or another cell's journal; the message says what and where",
    ExitCode.LOST: "the service ended as it was told to, and a journal could not take all that it had; the "
    "log says which and why",
    ExitCode.INTERRUPTED: "interrupted by Ctrl-C",
}
"""What each is for."""
COLUMNS = ("argument or option", "meaning", "default")
REQUIRED = "required"


def verbs() -> str:
    """Write the exit codes, and one section a verb."""
    parts = ["## Exit codes", "Of both programs; what is wrong is told on standard error.", _exit_codes()]
    for name, command in _verbs(typer.main.get_command(app), "impactcell"):
        rows = [_parameter(parameter) for parameter in command.params if parameter.name != "help"]
        parts += [f"## {name}", command.help or "", table(COLUMNS, rows)]
    for name, about, parser in _simulator_verbs():
        actions = [action for action in _actions(parser) if action.dest != "help"]
        parts += [f"## {name}", about, table(COLUMNS, map(_action, actions))]
    return "\n\n".join(parts)


def _exit_codes() -> str:
    return table(("code", "meaning"), [(str(int(one)), EXIT_CODES[one]) for one in ExitCode])


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
        name = value + (" ..." if parameter.nargs == -1 and not value.endswith("...") else "")
        name = name if parameter.required or name.startswith("[") else f"[{name}]"
    else:
        name = ", ".join(parameter.opts) + ("" if parameter.is_flag else f" {value}")
    default = parameter.default
    shown = "" if default is None or default is False or callable(default) else code(str(default))
    return code(name), _with_options(parameter.help or ""), REQUIRED if parameter.required else shown


def _with_options(text: str) -> str:
    """Write the options in a text as code: of plain ones the page makes dashes."""
    return re.sub(r"(?<![`\w-])--[a-z][a-z-]*", lambda option: code(option[0]), text)


def _simulator_verbs() -> Iterator[tuple[str, str, argparse.ArgumentParser]]:
    """Give the verbs of the simulator, which has a command line of its own."""
    (below,) = (action for action in _actions(_parser()) if isinstance(action.choices, dict))
    abouts = {one.dest: one.help for one in below._choices_actions}  # type: ignore[attr-defined]  # noqa: SLF001
    for name, parser in below.choices.items():
        about = abouts[name]
        yield f"python -m simulator {name}", f"{about[0].upper()}{about[1:]}.", parser


def _actions(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Give arguments and options of a parser; nothing public says them."""
    return parser._actions  # noqa: SLF001


def _action(action: argparse.Action) -> tuple[str, str, str]:
    value = "" if action.nargs == 0 else str(action.metavar or action.dest.upper())
    name = f"{', '.join(action.option_strings)} {value}".strip()
    return code(name), _with_options(action.help or ""), REQUIRED if action.required else ""
