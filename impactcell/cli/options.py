"""Options and arguments that several verbs share."""

import functools
import inspect
import logging
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, get_args

import typer


def _be_quiet(quiet: bool) -> None:  # noqa: FBT001 - typer's callback signature
    if quiet:
        logging.getLogger("impactcell").setLevel(logging.ERROR)


def _be_verbose(verbose: bool) -> None:  # noqa: FBT001 - typer's callback signature
    if verbose:
        logging.getLogger("impactcell").setLevel(logging.DEBUG)


_VERBOSITY = {
    "quiet": Annotated[bool, typer.Option("-q", "--quiet", help="Only errors.", callback=_be_quiet)],
    "verbose": Annotated[
        bool, typer.Option("-v", "--verbose", help="More of what happens.", callback=_be_verbose)
    ],
}
Cells = Annotated[list[Path], typer.Argument(metavar="CELL.yaml", help="One file a cell.")]
Cell = Annotated[Path, typer.Argument(metavar="CELL.yaml", help="A cell file.")]
OptionalCell = Annotated[
    Path | None, typer.Option("--cell", metavar="CELL.yaml", help="Use this cell's model.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Directory = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Where to write.")]


def _number(text: str) -> float:
    """Read a number, and say the way out where it is none."""
    try:
        return float(text)
    except ValueError as error:
        with_point = text.replace(",", ".", 1)
        is_comma = re.fullmatch(r"[+-]?\d*\.\d+", with_point) is not None
        way_out = f"decimals have a point: {with_point}" if is_comma else "write digits, as in 4.2"
        raise typer.BadParameter(f"{text!r} is no number; {way_out}") from error


def _with_numbers(parameter: inspect.Parameter) -> inspect.Parameter:
    """Give a parameter that is a number our own words for what is none."""
    kind, *details = get_args(parameter.annotation) or (parameter.annotation,)
    if kind in (float, float | None):
        for detail in details:
            if isinstance(detail, typer.models.OptionInfo):
                detail.parser = _number
    return parameter


def verb(group: typer.Typer, name: str | None = None) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a function a verb of `group`; it gets the options `-q` and `-v`, as every verb has them."""

    def decorate(function: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(function)
        def run(*arguments: object, **options: object) -> None:
            function(*arguments, **{key: value for key, value in options.items() if key not in _VERBOSITY})

        signature = inspect.signature(function)
        verbosity = [
            inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=kind)
            for key, kind in _VERBOSITY.items()
        ]
        run.__signature__ = signature.replace(  # type: ignore[attr-defined]
            parameters=[*map(_with_numbers, signature.parameters.values()), *verbosity]
        )
        run.__annotations__ = {**function.__annotations__, **_VERBOSITY}
        group.command(name)(run)
        return function

    return decorate
