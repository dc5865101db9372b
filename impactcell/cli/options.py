"""Options and arguments that several verbs share."""

import functools
import inspect
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

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
Cell = Annotated[Path, typer.Argument(metavar="CELL.yaml")]
OptionalCell = Annotated[
    Path | None, typer.Option("--cell", metavar="CELL.yaml", help="Use this cell's model.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Directory = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Where to write.")]


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
            parameters=[*signature.parameters.values(), *verbosity]
        )
        run.__annotations__ = {**function.__annotations__, **_VERBOSITY}
        group.command(name)(run)
        return function

    return decorate
