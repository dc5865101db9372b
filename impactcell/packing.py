"""Frozen dataclasses as few bytes and fast, and back to the same bits: for a state, written every cycle.

Layout, numbers little-endian::

    digest of the class   8 bytes: names and types of all fields, those of the classes within included
    length of the words   u32
    count of the numbers  u32
    words                 JSON list: whole numbers, texts, switches, shapes, lengths, what is None
    numbers               all floats, 64 bit
    arrays                one after the other

Nothing says where a value belongs but its place, which follows from the annotations: float, int, bool, str,
enums, arrays of floats, dataclasses, tuples of these, and any of them or None. `impactcell.values` writes the
same with names, to be read by people.
"""

import dataclasses
import enum
import hashlib
import json
import struct
import types
import typing
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
_HEAD = struct.Struct("<8sII")
_text = json.JSONEncoder(separators=(",", ":"), check_circular=False).encode


@dataclass(slots=True)
class _Sink:
    words: list[Any] = field(default_factory=list)
    numbers: list[float] = field(default_factory=list)
    arrays: list[bytes] = field(default_factory=list)


@dataclass(slots=True)
class _Source:
    words: Iterator[Any]
    numbers: Iterator[float]
    arrays: memoryview


@dataclass(frozen=True, slots=True)
class _Form:
    """How values of one type are written and read.

    Attributes
    ----------
    name : str
        What the digest is made of.
    word : callable or None
        Makes the value from a single word, where it is one.
    suffix : str
        Attribute of the value that is its word.
    """

    name: str
    write: Callable[[Any, _Sink], None]
    read: Callable[[_Source], Any]
    word: Callable[[Any], Any] | None = None
    suffix: str = ""


def pack(value: object) -> bytes:
    """Write a dataclass; equal values give equal bytes.

    Raises
    ------
    TypeError
        It holds what cannot be written, or not what its annotations say.
    """
    kind: Any = type(value)
    form, sink = _form(kind), _Sink()
    form.write(value, sink)
    words, count = _text(sink.words).encode(), len(sink.numbers)
    try:
        numbers = struct.pack(f"<{count}d", *sink.numbers)
    except struct.error as error:
        raise TypeError(f"{kind.__name__} holds no number where there should be one: {error}") from error
    head = _HEAD.pack(_digest(form), len(words), count)
    return b"".join((head, words, numbers, *sink.arrays))


def unpack(kind: type[T], data: bytes) -> T:
    """Read back what `pack` wrote for a value of class `kind`.

    Raises
    ------
    ValueError
        The bytes are not a `kind`, or of another version of it.
    """
    wanted: Any = kind
    form = _form(wanted)
    try:
        digest, length, count = _HEAD.unpack_from(data)
        if digest != _digest(form):
            raise ValueError(f"not a stored {kind.__name__}: its fields are others")
        first = _HEAD.size + length
        words = json.loads(data[_HEAD.size : first])
        numbers = struct.unpack_from(f"<{count}d", data, first)
        source = _Source(iter(words), iter(numbers), memoryview(data)[first + 8 * count :])
        value: T = form.read(source)
    except (struct.error, TypeError, KeyError, StopIteration) as error:
        raise ValueError(f"not a stored {kind.__name__}: {error!r}") from error
    if next(source.words, None) is not None or next(source.numbers, None) is not None or source.arrays:
        raise ValueError(f"not a stored {kind.__name__}: more than it holds")
    return value


@cache
def _digest(form: _Form) -> bytes:
    return hashlib.blake2b(form.name.encode(), digest_size=8).digest()


@cache
def _form(kind: Any) -> _Form:
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if kind in (int, bool, str, types.NoneType):
        return _word(kind.__name__, lambda word: word)
    if kind is float:
        return _Form("float", lambda value, sink: sink.numbers.append(value), lambda s: next(s.numbers))
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return _word(f"{kind.__name__}{[*kind.__members__]}", kind.__getitem__, "_name_")
    if dataclasses.is_dataclass(kind):
        return _of_dataclass(kind)
    if origin is np.ndarray:
        return _Form("array", _write_array, _read_array)
    if origin in (typing.Union, types.UnionType) and len(inner) == 2 and types.NoneType in inner:
        return _or_none(*(_form(one) for one in inner if one is not types.NoneType))
    if origin is tuple and inner[-1] is Ellipsis:
        return _of_many(_form(inner[0]))
    if origin is tuple:
        return _of_each([_form(one) for one in inner])
    raise TypeError(f"{kind} has no packed form")


def _word(name: str, make: Callable[[Any], Any], suffix: str = "") -> _Form:
    of: Callable[[Any], Any] = attrgetter(suffix) if suffix else lambda value: value
    return _Form(
        name,
        lambda value, sink: sink.words.append(of(value)),
        lambda source: make(next(source.words)),
        make,
        suffix,
    )


def _or_none(form: _Form) -> _Form:
    name = f"{form.name}?"
    if form.word is not None and not form.suffix:
        return _word(name, lambda word: word)

    def write(value: Any, sink: _Sink) -> None:
        sink.words.append(value is not None)
        if value is not None:
            form.write(value, sink)

    return _Form(name, write, lambda source: form.read(source) if next(source.words) else None)


def _of_many(form: _Form) -> _Form:
    name = f"{form.name}*"
    if form.word is not None and not form.suffix:
        return _word(name, tuple)

    def write(value: Any, sink: _Sink) -> None:
        sink.words.append(len(value))
        for one in value:
            form.write(one, sink)

    return _Form(name, write, lambda source: tuple([form.read(source) for _ in range(next(source.words))]))


def _of_each(forms: list[_Form]) -> _Form:
    def write(value: Any, sink: _Sink) -> None:
        for form, one in zip(forms, value, strict=True):
            form.write(one, sink)

    name = f"({','.join(form.name for form in forms)})"
    return _Form(name, write, lambda source: tuple([form.read(source) for form in forms]))


def _of_dataclass(kind: Any) -> _Form:
    """Numbers first, then words, both taken from the value at once; then the rest."""
    hints = typing.get_type_hints(kind)
    forms = {one.name: _form(hints[one.name]) for one in dataclasses.fields(kind)}
    floats = [name for name in forms if hints[name] is float]
    words = {name: form.word for name, form in forms.items() if form.word is not None}
    rest = [(name, form) for name, form in forms.items() if name not in words and name not in floats]
    numbers_of = _all_of(floats)
    words_of = _all_of([f"{name}.{forms[name].suffix}".rstrip(".") for name in words])
    others = [(attrgetter(name), form.write) for name, form in rest]

    def write(value: Any, sink: _Sink) -> None:
        sink.numbers += numbers_of(value)
        sink.words += words_of(value)
        for of, write_one in others:
            write_one(of(value), sink)

    def read(source: _Source) -> Any:
        found = {name: next(source.numbers) for name in floats}
        found |= {name: make(next(source.words)) for name, make in words.items()}
        found |= {name: form.read(source) for name, form in rest}
        return kind(**found)

    listed = ",".join(f"{name}:{form.name}" for name, form in forms.items())
    return _Form(f"{kind.__name__}({listed})", write, read)


def _all_of(names: list[str]) -> Callable[[Any], tuple[Any, ...]]:
    """Give many attributes at once, always as a tuple."""
    if len(names) > 1:
        return attrgetter(*names)
    one = attrgetter(*names) if names else None
    return lambda value: (one(value),) if one else ()


def _write_array(value: Any, sink: _Sink) -> None:
    if value.dtype != np.float64:
        raise TypeError(f"an array of {value.dtype} has no packed form")
    sink.words.append(value.shape)
    sink.arrays.append(value.astype("<f8", copy=False).tobytes())


def _read_array(source: _Source) -> Any:
    shape = next(source.words)
    count = int(np.prod(shape, dtype=np.int64))
    array = np.frombuffer(source.arrays, "<f8", count).astype(np.float64).reshape(shape)
    source.arrays = source.arrays[8 * count :]
    return array
