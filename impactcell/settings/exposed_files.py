"""Files that grant access, and are open to others than their owner: users file and private keys."""

import os
import shlex
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from impactcell.opcua.own_certificate import KEY
from impactcell.settings.remark import Remark
from impactcell.settings.sections import CellSettings

_WRITTEN: Final = stat.S_IWGRP | stat.S_IWOTH
"""Mode bits of a file that others than its owner can write."""
_READ: Final = stat.S_IROTH
"""Mode bit of a file that everybody can read; a group of its own may be there to."""


def exposed_files(settings: CellSettings) -> Iterator[Remark]:
    """Say which of the files that grant access others than their owner can write, or everybody can read."""
    if os.name != "posix":  # elsewhere a mode tells nothing of who may
        return
    for place, what, file in _granting_access(settings):
        if can := _what_others_can(file):
            way_out = f"run `chmod 600 {shlex.quote(str(file))}`"
            yield Remark(
                place, f"others than its owner can {can} the {what} {file}: {way_out}", is_fault=False
            )


def _granting_access(settings: CellSettings) -> Iterator[tuple[tuple[str, ...], str, Path]]:
    """Give each such file with the keys that name it and what it is."""
    key, web, tls = "private key", settings.web, settings.module.tls
    yield ("opcua", "users_file"), "users file", settings.opcua.users_file
    yield ("opcua", "certificates_dir"), key, settings.opcua.certificates_dir / "own" / KEY
    if web is not None and web.key is not None:
        yield ("web", "key"), key, web.key
    if tls is not None and tls.certificate is not None:
        name = "certificate" if tls.key is None else "key"
        yield ("module", "tls", name), key, tls.key or tls.certificate


def _what_others_can(file: Path) -> str:
    """Say what others than its owner can do with a file; nothing with one that cannot be looked at."""
    try:
        mode = file.stat().st_mode
    except (OSError, ValueError):
        return ""
    if not stat.S_ISREG(mode):
        return ""
    can = {"read": mode & _READ, "write": mode & _WRITTEN}
    return " and ".join(word for word, bits in can.items() if bits)
