"""One typed door to numba, so that strict type checking reaches through compiled code."""

# ruff: noqa: ARG001  # an intrinsic's arguments are read from its signature, not by name

import fcntl
import functools
import hashlib
import inspect
import re
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, ParamSpec, Protocol, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import cfunc, njit, types
from numba.core.caching import FunctionCache
from numba.extending import intrinsic
from numpy.typing import NDArray

from impactcell.numerics.compilation import announce_compilation

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
pointer_to: Any = types.CPointer
P = ParamSpec("P")
R = TypeVar("R")


class FloatPointer(Protocol):
    """Bare pointer to floating-point numbers; an array will do where nothing is compiled."""

    def __getitem__(self, index: int, /) -> float: ...
    def __setitem__(self, index: int, value: float, /) -> None: ...


class IntPointer(Protocol):
    """Bare pointer to whole numbers."""

    def __getitem__(self, index: int, /) -> int: ...
    def __setitem__(self, index: int, value: int, /) -> None: ...


Law = Callable[[float, float, float, float, FloatPointer], float]
"""A law of the plant: four numbers and the parameters of its effect in, one number out."""

MOST_LOOKS: Final = 1500
"""Looks whether another process has compiled a function, half a minute in all: three times what the longest
takes. Then it is compiled here as well."""
_BETWEEN_LOOKS_S: Final = 0.02
"""Between two of them, s."""
_POINTERS: dict[Law, Any] = {}

_IMPORTED_ROOM = re.compile(rb"^from impactcell\.(\w+)", re.MULTILINE)
"""What a source says of the rooms from which it takes compiled functions."""


@functools.cache
def _digest(room: Path) -> str:
    """Digest of the sources of a room, its inner rooms included, and of the rooms that it imports from."""
    package = Path(__file__).resolve().parents[1]
    sources = {source: source.read_bytes() for source in sorted(room.rglob("*.py"))}
    imported = {name for text in sources.values() for name in _IMPORTED_ROOM.findall(text)}
    for name in sorted({b"numerics", *imported} - {room.name.encode()}):
        for source in sorted((package / name.decode()).rglob("*.py")):
            sources[source] = source.read_bytes()
    hashed = hashlib.sha256()
    for text in sources.values():
        hashed.update(text)
    return hashed.hexdigest()


def _room(function: Callable[..., Any]) -> Path:
    """Folder next below the package that a function's file lies in."""
    source, package = Path(inspect.getfile(function)).resolve(), Path(__file__).resolve().parents[1]
    inside = source.is_relative_to(package) and len(source.relative_to(package).parts) > 1
    return package / source.relative_to(package).parts[0] if inside else source.parent


class _Turns:
    """Has one process at a time compile what a file defines, and write it to disk; the others then read it.

    What is compiled on the way to a function comes from its file or from one that this imports, so two
    processes never wait for each other. A process holds the turns of all files that it is at; numba has one
    thread of a process compile at a time.
    """

    def __init__(self) -> None:
        self._held: list[tuple[object, str, IO[bytes] | None]] = []

    def take(self, holder: object, file: str) -> None:
        """Wait for the turn of a file, unless this process has it, or that takes too long."""
        source = None
        if all(name != file for _, name, _ in self._held):
            source = Path(file).open("rb")  # noqa: SIM115 - open as long as the turn is held
            looks = 0
            while not _is_locked(source) and looks < MOST_LOOKS:
                looks += 1
                threading.Event().wait(_BETWEEN_LOOKS_S)
        self._held.append((holder, file, source))

    def give_back(self, holder: object) -> None:
        """End a turn, and with it those taken on the way whose functions could not be compiled."""
        holders = [held for held, _, _ in self._held]
        begin = len(holders) - 1 - holders[::-1].index(holder)
        for _, _, source in self._held[begin:]:
            if source is not None:
                source.close()  # and so unlocked
        del self._held[begin:]


_turns = _Turns()


def _is_locked(source: IO[bytes]) -> bool:
    """Lock a file for this process if no other has; true as well where the file system knows no locks."""
    try:
        fcntl.flock(source, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


class _Cache(FunctionCache):
    """Machine code on disk, used again only while the sources of its room and those it imports are the same.

    By itself numba looks at the function's own file, and would go on using code into which an older
    version of a function from another file has been compiled. It also has every process compile for itself
    that does not find the code, and lose what another wrote to an index meanwhile.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        self._digest = _digest(_room(function))
        self._source = inspect.getfile(function)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Give machine code from disk; without any the caller compiles, and saves what came of it."""
        code = self._loaded(sig, target_context)
        if code is None:
            announce_compilation()
            _turns.take(self, self._source)
            code = self._loaded(sig, target_context)  # another process may have compiled it meanwhile
            if code is not None:
                _turns.give_back(self)
        return code

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write machine code to disk."""
        try:
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        finally:
            _turns.give_back(self)

    def _loaded(self, sig: Any, target_context: Any) -> Any:
        """Give machine code from disk; an index that names a class this version lacks is begun anew."""
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except (AttributeError, ImportError):
            self.flush()  # type: ignore[no-untyped-call]
            return None

    def _index_key(self, signature: Any, codegen: Any) -> tuple[Any, ...]:
        return (*super()._index_key(signature, codegen), self._digest)  # type: ignore[no-untyped-call]


def _can_cache(function: Callable[..., Any]) -> bool:
    """Whether there is a place to keep machine code; a read-only installation without a home has none."""
    try:
        FunctionCache(function)  # type: ignore[no-untyped-call]
    except RuntimeError:
        return False
    return True


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` to machine code on its first call, cached on disk between processes.

    IEEE arithmetic is kept (no fast-math): NaN and infinity mean the same as in Python, and a
    replay gives the same bits. What it calls of other compiled
    functions lies in its room or in one that its room imports.
    """
    return _compiled(function, into_callers=False)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` as `compiled` does, and into every compiled function that calls it.

    For small functions at the bottom of a long computation, where a call costs as much as what it does. The
    arithmetic stays the same to the last bit.
    """
    return _compiled(function, into_callers=True)


def _compiled(function: Callable[P, R], *, into_callers: bool) -> Callable[P, R]:
    dispatcher: Any = njit(error_model="numpy", nogil=True, forceinline=into_callers)(function)
    if _can_cache(function):
        dispatcher._cache = _Cache(function)  # noqa: SLF001  # what njit(cache=True) does, with the plain cache
    return cast("Callable[P, R]", dispatcher)


def address(law: Law) -> int:
    """Compile `law` to a C function of fixed signature and return where it lies.

    Compiled code calls it through `invoke`, so that code which combines laws is compiled once and not once
    for each combination. A division by zero is infinite or not a number, as everywhere in compiled code: an
    exception could not leave such a function. Cached on disk like everything else.
    """
    if law not in _POINTERS:
        double = types.float64
        signature = double(double, double, double, double, pointer_to(double))
        _POINTERS[law] = cfunc(signature, cache=_can_cache(law), error_model="numpy")(law)
    return int(_POINTERS[law].address)


@dataclass(frozen=True, slots=True)
class _Placed:
    """Machine code that was not made by numba, and what keeps it in memory."""

    address: int
    owner: object


def place_at(law: Law, where: int, owner: object) -> None:
    """Say where the machine code of a law lies that somebody else has compiled, and what keeps it there."""
    _POINTERS[law] = _Placed(where, owner)


@intrinsic
def _invoke(_context, where, first, second, third, fourth, data, offset):  # type: ignore[no-untyped-def]
    double = types.float64
    signature = double(types.int64, double, double, double, double, pointer_to(double), types.int64)

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        where, first, second, third, fourth, data, offset = arguments
        number = ir.DoubleType()
        kind = ir.FunctionType(number, [number] * 4 + [number.as_pointer()])
        function = builder.inttoptr(where, kind.as_pointer())
        return builder.call(function, [first, second, third, fourth, builder.gep(data, [offset])])

    return signature, generate


@intrinsic
def _pointer(_context, array):  # type: ignore[no-untyped-def]
    signature = pointer_to(array.dtype)(array)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, arguments[0]).data

    return signature, generate


@intrinsic
def _advance(_context, data, count):  # type: ignore[no-untyped-def]
    signature = data(data, types.int64)

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.gep(arguments[0], [arguments[1]])

    return signature, generate


invoke = cast("Callable[[int, float, float, float, float, FloatPointer, int], float]", _invoke)
"""Call the law at an address with four numbers and the parameters from `row[offset]` on."""

float_pointer = cast("Callable[[FloatArray], FloatPointer]", _pointer)
"""Bare pointer to a contiguous array's data, for compiled code only.

Indexed like the array, but without bounds, shape or reference count, whose upkeep would cost more than the
arithmetic in functions as small as those of a plant. Whoever makes one keeps the array alive.
"""

int_pointer = cast("Callable[[IntArray], IntPointer]", _pointer)
"""The same for whole numbers."""

advance = cast("Callable[[FloatPointer, int], FloatPointer]", _advance)
"""Pointer `count` elements further on."""
