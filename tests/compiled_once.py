"""Machine code that the workers of one run share: each function is compiled by one, and read by the others.

On a fresh checkout the workers of pytest-xdist need the same functions at about the same time; each would
compile them, and write the index of what is cached over that of the others.
"""

import contextlib
import fcntl
import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from numba.core.ccallback import CFunc
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

Compile = Callable[..., Any]


@contextlib.contextmanager
def sharing(directory: Path) -> Iterator[None]:
    """Let one worker compile a function while the others wait; `directory` is the same for all workers."""
    directory.mkdir(exist_ok=True)
    held: set[Path] = set()

    @contextlib.contextmanager
    def alone(function: Callable[..., Any]) -> Iterator[None]:
        code = function.__code__
        name = f"{code.co_filename}:{code.co_firstlineno}:{function.__qualname__}"
        file = directory / hashlib.sha256(name.encode()).hexdigest()
        # Numba's own lock comes first: a thread that waits for another worker must not hold what one of
        # its own process waits for.
        with global_compiler_lock:
            if file in held:  # it calls itself
                yield
                return
            held.add(file)
            try:
                with file.open("w") as lock:
                    fcntl.flock(lock, fcntl.LOCK_EX)
                    yield
            finally:
                held.remove(file)

    def compile_function(self: Any, signature: Any) -> Any:
        with alone(self.py_func):
            return whole_function(self, signature)

    def compile_law(self: Any) -> Any:
        with alone(self.__wrapped__):
            return whole_law(self)

    whole_function: Compile = Dispatcher.compile
    whole_law: Compile = CFunc.compile
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dispatcher, "compile", compile_function)
        patch.setattr(CFunc, "compile", compile_law)
        yield
