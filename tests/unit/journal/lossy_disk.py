"""What SQLite asks of the file system, and what a disk may hold after a power cut at any moment of that.

The default VFS of the SQLite library that this process uses is given hooks (SQLite, The OS Interface): every
write, truncation, synchronisation and removal of a file, and every synchronisation of a directory, is written
down and then done. `disk_after_cut` builds from that what a disk may hold: all that was synchronised, and of
the rest any part, in sectors, whatever their order was. A file whose directory was not synchronised since it
was made or removed may be there or not.
"""

import ctypes
import ctypes.util
import random
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import CFUNCTYPE, POINTER, Structure, c_char_p, c_int, c_int64, c_void_p
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

SECTOR = 512
"""Bytes that a disk writes all or not at all."""


class _Methods(Structure):
    """`sqlite3_io_methods`, up to version 3."""

    _fields_ = (
        ("version", c_int),
        *((name, c_void_p) for name in ("close", "read", "write", "truncate", "sync", "size")),
        *((name, c_void_p) for name in ("lock", "unlock", "reserved", "control", "sector", "device")),
        *((name, c_void_p) for name in ("shm_map", "shm_lock", "shm_barrier", "shm_unmap")),
        *((name, c_void_p) for name in ("fetch", "unfetch")),
    )


class _File(Structure):
    """`sqlite3_file`."""

    _fields_ = (("methods", POINTER(_Methods)),)


class _Vfs(Structure):
    """`sqlite3_vfs`, version 3."""

    _fields_ = (
        ("version", c_int),
        ("file_size", c_int),
        ("longest_path", c_int),
        ("next", c_void_p),
        ("name", c_char_p),
        ("data", c_void_p),
        *((name, c_void_p) for name in ("open", "delete", "access", "full_path")),
        *((name, c_void_p) for name in ("dl_open", "dl_error", "dl_sym", "dl_close")),
        *((name, c_void_p) for name in ("randomness", "sleep", "time", "last_error", "time_64")),
        *((name, c_void_p) for name in ("set_call", "get_call", "next_call")),
    )


_OPEN = CFUNCTYPE(c_int, c_void_p, c_void_p, POINTER(_File), c_int, POINTER(c_int))
"""The path as a pointer: SQLite's own string has to outlive the call."""
_DELETE = CFUNCTYPE(c_int, c_void_p, c_char_p, c_int)
_WRITE = CFUNCTYPE(c_int, POINTER(_File), c_void_p, c_int, c_int64)
_TRUNCATE = CFUNCTYPE(c_int, POINTER(_File), c_int64)
_SYNC = CFUNCTYPE(c_int, POINTER(_File), c_int)
_GET_CALL = CFUNCTYPE(c_void_p, c_void_p, c_char_p)
_SET_CALL = CFUNCTYPE(c_int, c_void_p, c_char_p, c_void_p)
_OPEN_DIRECTORY = CFUNCTYPE(c_int, c_char_p, POINTER(c_int))


@dataclass(frozen=True, slots=True)
class Step:
    """Something that was asked of the file system: `what` of the file `name`."""

    what: str
    name: str = ""
    at: int = 0
    data: bytes = b""


@dataclass(slots=True, eq=False)
class Recording:
    """All steps in their order; a test adds its own with `mark`."""

    steps: list[Step] = field(default_factory=list)

    def mark(self, what: str, number: int) -> None:
        """Write down something that a test did, with a number."""
        self.steps.append(Step(what, at=number))


@contextmanager
def recorded() -> Iterator[Recording]:
    """Record what SQLite does to files that are opened meanwhile."""
    library = ctypes.CDLL(ctypes.util.find_library("sqlite3"))
    library.sqlite3_vfs_find.restype = POINTER(_Vfs)
    library.sqlite3_vfs_register.argtypes = library.sqlite3_vfs_unregister.argtypes = (POINTER(_Vfs), c_int)
    library.sqlite3_vfs_unregister.argtypes = (POINTER(_Vfs),)
    system = library.sqlite3_vfs_find(None)
    hooks = _Hooks(system.contents)
    library.sqlite3_vfs_register(ctypes.byref(hooks.vfs), 1)
    try:
        yield hooks.recording
    finally:
        hooks.remove()
        library.sqlite3_vfs_unregister(ctypes.byref(hooks.vfs))
        library.sqlite3_vfs_register(system, 1)


class _Hooks:
    """A VFS that records, on top of another."""

    def __init__(self, system: Any) -> None:
        self.recording = Recording()
        self._system = system
        self._names: dict[int, str] = {}
        self._methods: dict[int, tuple[_Methods, tuple[Any, ...]]] = {}
        self.vfs = _Vfs()
        ctypes.memmove(ctypes.byref(self.vfs), ctypes.byref(system), ctypes.sizeof(_Vfs))
        self.vfs.name = b"recording"
        self._kept = _OPEN(self._open), _DELETE(self._delete), _OPEN_DIRECTORY(self._open_directory)
        self.vfs.open, self.vfs.delete = (ctypes.cast(hook, c_void_p).value for hook in self._kept[:2])
        self._directory = _GET_CALL(system.get_call)(ctypes.byref(system), b"openDirectory")
        self._set_directory(ctypes.cast(self._kept[2], c_void_p).value)

    def remove(self) -> None:
        """Give the system its own way to open a directory back."""
        self._set_directory(self._directory)

    def _set_directory(self, function: int | None) -> None:
        _SET_CALL(self._system.set_call)(ctypes.byref(self._system), b"openDirectory", function)

    def _record(self, *step: Any) -> None:
        self.recording.steps.append(Step(*step))

    def _open(self, vfs: int, path_at: int | None, file: Any, flags: int, out: Any) -> int:
        path = None if path_at is None else Path(ctypes.string_at(path_at).decode())
        is_new = path is not None and not path.exists()
        result = _OPEN(self._system.open)(vfs, path_at, file, flags, out)
        if result or path is None:
            return int(result)
        name = path.name
        if is_new:
            self._record("made", name)
        address = ctypes.cast(file, c_void_p).value
        assert address is not None
        self._names[address] = name
        file.contents.methods = ctypes.pointer(self._hooked(file.contents.methods))
        return 0

    def _hooked(self, methods: Any) -> _Methods:
        """Copy the methods of an open file, with hooks."""
        at = ctypes.cast(methods, c_void_p).value
        assert at is not None
        if at not in self._methods:
            system, copy = methods.contents, _Methods()
            ctypes.memmove(ctypes.byref(copy), methods, ctypes.sizeof(_Methods))
            write, truncate, sync = _WRITE(system.write), _TRUNCATE(system.truncate), _SYNC(system.sync)

            def on_write(file: Any, data: int, size: int, offset: int) -> int:
                self._record("write", self._name(file), offset, ctypes.string_at(data, size))
                return int(write(file, data, size, offset))

            def on_truncate(file: Any, size: int) -> int:
                self._record("truncate", self._name(file), size)
                return int(truncate(file, size))

            def on_sync(file: Any, flags: int) -> int:
                result = int(sync(file, flags))
                self._record("sync", self._name(file))
                return result

            hooks = _WRITE(on_write), _TRUNCATE(on_truncate), _SYNC(on_sync)
            copy.write, copy.truncate, copy.sync = (ctypes.cast(hook, c_void_p).value for hook in hooks)
            self._methods[at] = copy, hooks
        return self._methods[at][0]

    def _name(self, file: Any) -> str:
        return self._names[ctypes.cast(file, c_void_p).value or 0]

    def _delete(self, vfs: int, path: bytes, synchronise: int) -> int:
        result = int(_DELETE(self._system.delete)(vfs, path, synchronise))
        if not result:
            self._record("removed", Path(path.decode()).name)
        return result

    def _open_directory(self, path: bytes, out: Any) -> int:
        self._record("sync directory")
        return int(_OPEN_DIRECTORY(self._directory)(path, out))


@dataclass(slots=True, eq=False)
class _Stored:
    """A file on the disk: what is surely there, and what is on its way."""

    safe: bytearray = field(default_factory=bytearray)
    pending: list[Step] = field(default_factory=list)

    def synchronise(self) -> None:
        for step in self.pending:
            _apply(self.safe, step)
        self.pending.clear()

    def after_cut(self, draw: random.Random, share: float) -> bytes:
        """What there is of it: of each pending write some sectors, of all pending ones about `share`."""
        content = bytearray(self.safe)
        for step in self.pending:
            if step.what == "truncate":
                if draw.random() < share:
                    _apply(content, step)
                continue
            first = 0
            while first < len(step.data):
                end = min(len(step.data), (step.at + first) // SECTOR * SECTOR + SECTOR - step.at)
                if draw.random() < share:
                    _apply(content, Step("write", step.name, step.at + first, step.data[first:end]))
                first = end
        return bytes(content)


def _apply(content: bytearray, step: Step) -> None:
    if step.what == "truncate":
        del content[step.at :]
        content.extend(bytes(step.at - len(content)))
        return
    content.extend(bytes(max(0, step.at - len(content))))
    content[step.at : step.at + len(step.data)] = step.data


def disk_after_cut(steps: list[Step], directory: Path, draw: random.Random) -> None:
    """Write the files of a disk whose power was cut after `steps`, one of the many ways that it may be."""
    files: dict[str, _Stored] = {}
    safe: dict[str, _Stored] = {}
    for step in steps:
        if step.what == "made":
            files[step.name] = _Stored()
        elif step.what == "removed":
            files.pop(step.name, None)
        elif step.what == "sync directory":
            safe = dict(files)
        elif step.what == "sync":
            files[step.name].synchronise()
        elif step.what in ("write", "truncate"):
            files[step.name].pending.append(step)
    share = draw.choice((0.0, 0.5, 0.9, 1.0))
    for name in sorted({*files, *safe}):
        stored = draw.choice((safe.get(name), files.get(name)))
        if stored is not None and not name.endswith("-shm"):
            (directory / name).write_bytes(stored.after_cut(draw, share))
