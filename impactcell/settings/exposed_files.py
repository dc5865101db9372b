"""Files that grant access, and are open to others than their owner: users file and private keys."""

import shlex
from collections.abc import Iterator
from pathlib import Path

from impactcell.opcua.certificates.own_certificate import KEY
from impactcell.process.file_access import what_others_can
from impactcell.settings.remark import Remark
from impactcell.settings.sections import CellSettings


def exposed_files(settings: CellSettings) -> Iterator[Remark]:
    """Say which of the files that grant access others than their owner can write, or everybody can read."""
    for place, what, file in files_granting_access(settings):
        if can := " and ".join(what_others_can(file)):
            way_out = f"run `chmod 600 {shlex.quote(str(file))}`"
            yield Remark(
                place, f"others than its owner can {can} the {what} {file}: {way_out}", is_fault=False
            )


def files_granting_access(settings: CellSettings) -> Iterator[tuple[tuple[str, ...], str, Path]]:
    """Give each such file with the keys that name it and what it is."""
    key, web, tls = "private key", settings.web, settings.module.tls
    yield ("opcua", "users_file"), "users file", settings.opcua.users_file
    yield ("opcua", "certificates_dir"), key, settings.opcua.certificates_dir / "own" / KEY
    if web is not None and web.key is not None:
        yield ("web", "key"), key, web.key
    if tls is not None and tls.certificate is not None:
        name = "certificate" if tls.key is None else "key"
        yield ("module", "tls", name), key, tls.key or tls.certificate
