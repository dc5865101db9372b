"""Progress of a verb: a bar on a terminal, lines for a program that asks for them, nothing anywhere else."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from impactcell.numerics.compilation import COMPILING
from impactcell.process.console import print_note

LINES_VARIABLE: Final = "IMPACTCELL_STEPS"
"""Variable of the environment that asks for a line a step on standard error."""
STEP_PREFIX: Final = "step: "
"""Begins such a line."""


@contextmanager
def progress(what: str, steps: int) -> Iterator[Callable[[], None]]:
    """Show a bar on standard error while the block runs, if that is a terminal.

    Yields
    ------
    callable
        To be called after each of `steps` steps.
    """
    if not sys.stderr.isatty():
        if LINES_VARIABLE in os.environ:
            write_step(what)
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=steps)
        yield lambda: bar.advance(task)


@contextmanager
def named_steps() -> Iterator[Callable[[str], None]]:
    """Show which step is being done while the block runs.

    Yields
    ------
    callable
        To be called with the name of each step as it begins.
    """
    if not sys.stderr.isatty():
        yield write_step if LINES_VARIABLE in os.environ else lambda _: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading", total=None)
        yield lambda step: bar.update(task, description=step)


def say_compiling() -> None:
    """Say why nothing happens for a while; to a program that asks for steps, as one."""
    if LINES_VARIABLE in os.environ and not sys.stderr.isatty():
        write_step(COMPILING)
    else:
        print_note(COMPILING)


def write_step(name: str) -> None:
    """Write one step's line."""
    sys.stderr.write(f"{STEP_PREFIX}{name}\n")
    sys.stderr.flush()
