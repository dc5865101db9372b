"""One typed door to numba, so that strict type checking reaches through compiled code."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from numba import njit

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` to machine code on its first call, cached on disk between processes.

    IEEE arithmetic is kept (no fast-math): NaN and infinity mean the same as in Python, and a
    replay gives the same bits.
    """
    return cast("Callable[P, R]", njit(cache=True, error_model="numpy")(function))
