"""`impactcell users` and `impactcell certs`: who may connect over OPC UA."""

import getpass
import shlex
import sys
from datetime import UTC, datetime
from pathlib import Path

from cryptography import x509

from impactcell.cli.paths import check_directory, check_output, kind_of
from impactcell.errors import AccessError
from impactcell.opcua.certificates.certificate_dates import validity_mark
from impactcell.opcua.certificates.certificate_files import der, fingerprint, read_certificate, thumbprint
from impactcell.opcua.certificates.making import make_certificate, own_hosts, write_pair
from impactcell.opcua.certificates.own_certificate import KEY
from impactcell.opcua.certificates.trust_list import FOLDERS, is_revocation_list, make_folders
from impactcell.opcua.host_interface import Role
from impactcell.process.console import print_result
from impactcell.process.path_kind import Kind
from impactcell.scada.interface import default_application_uri
from impactcell.scada.rights import matrix_table
from impactcell.scada.users import User, read_users, with_password, write_users
from impactcell.settings.fields import module_host

MIN_PASSWORD = 8
"""Characters of a password, at least (NIST SP 800-63B, 5.1.1.2)."""


def add_user(file: Path, name: str, role: str = "observer", certificate: Path | None = None) -> None:
    """Add a user, or replace the password, certificate or role of one.

    The password is asked for twice on a terminal and read as one line otherwise. With a certificate the
    user logs in by that and is asked for no password.

    Raises
    ------
    AccessError
        Unknown role, a password that is too short or typed differently, or a file that cannot be used.
    """
    roles = {role_name.name.lower(): role_name for role_name in Role}
    if role.lower() not in roles:
        raise AccessError(f"{role!r} is not a role; choose one of {', '.join(roles)}")
    if not name.strip() or not name.isprintable():
        raise AccessError("a user needs a name that can be printed")
    check_output(file, AccessError)  # before anybody is asked for a password
    users = read_users(file)
    before = users.get(name)
    user = User(name, roles[role.lower()], before.password if before is not None else None)
    if certificate is not None:
        print_ = fingerprint(der(_client_certificate(certificate)))
        user = User(name, user.role, user.password, print_)
    else:
        user = with_password(user, _ask_password(name))
    users[name] = user
    write_users(file, users)
    verb = "changed" if before is not None else "added"
    print_result(f"{name} {verb} as {user.role.name.lower()} in {file}")


def _client_certificate(file: Path) -> x509.Certificate:
    try:
        return read_certificate(file)
    except AccessError as error:
        raise AccessError(
            f"{error}; name the client's certificate (.der, .pem or .crt): it exports it, or it lies in the "
            "`rejected` folder of the server's certificates once the client has tried to connect"
        ) from error


def _ask_password(name: str) -> str:
    if sys.stdin.isatty():
        password = getpass.getpass(f"Password for {name}: ")
        if getpass.getpass("Once more: ") != password:
            raise AccessError("the two passwords differ; nothing has been changed")
    else:
        password = sys.stdin.readline().rstrip("\r\n")
    if len(password) < MIN_PASSWORD:
        raise AccessError(f"a password has at least {MIN_PASSWORD} characters; nothing has been changed")
    return password


def remove_user(file: Path, name: str) -> None:
    """Remove a user; open sessions of the user end within a second.

    Raises
    ------
    AccessError
        There is no such user or no such file, or it cannot be used.
    """
    if kind_of(file, AccessError) is Kind.NOTHING:
        raise AccessError(f"{file}: is not there; name the cell's `opcua.users_file`")
    users = read_users(file)
    if name not in users:
        raise AccessError(f"{file}: there is no user {name!r}; see `impactcell users list {file}`")
    del users[name]
    write_users(file, users)
    print_result(f"{name} removed from {file}")


def list_users(file: Path, *, rights: bool = False) -> None:
    """List users with their roles; with `rights` also what each role may do.

    Raises
    ------
    AccessError
        The file is absent or cannot be used.
    """
    if kind_of(file, AccessError) is Kind.NOTHING:
        raise AccessError(
            f"{file}: is not there; make it with `impactcell users add {shlex.quote(str(file))} NAME`"
        )
    for user in read_users(file).values():
        ways = [way for way, has in (("password", user.password), ("certificate", user.certificate)) if has]
        _say(f"{user.name}\t{user.role.name.lower()}\t{' and '.join(ways)}")
    if rights:
        _say()
        _say(matrix_table())


def make_certs(pki: Path, application_uri: str | None = None, hosts: list[str] | None = None) -> None:
    """Make the server's certificate and key, and the folders of the trust list.

    Raises
    ------
    AccessError
        There is a certificate already, the directory cannot be written, or a host is none.
    """
    for host in hosts or ():
        try:
            module_host(host)
        except ValueError as error:
            raise AccessError(f"--host {host!r}: {error}") from error
    check_directory(pki, AccessError)
    uri = application_uri or default_application_uri()
    certificate, key = make_certificate("impactcell", uri, [*(hosts or []), *own_hosts()])
    make_folders(pki)
    path, _ = write_pair(pki / "own", certificate, key)
    print_result(f"{path}: certificate of {uri}, valid until {certificate.not_valid_after_utc:%Y-%m-%d}")
    print_result(f"SHA-1 {thumbprint(der(certificate))}")


def trust_cert(file: Path, pki: Path | None = None) -> None:
    """Let a certificate connect; takes effect at once, without a restart.

    Parameters
    ----------
    file : Path
        A client's certificate, usually one that the server has put into `rejected`.
    pki : Path, optional
        Directory of the trust list; where `file` lies in its `rejected` folder it is found from there.

    Raises
    ------
    AccessError
        `file` is no certificate, or it is not clear which trust list is meant.
    """
    certificate = _client_certificate(file)
    inferred = file.resolve().parent
    if pki is None:
        if inferred.name != "rejected" or not (inferred.parent / "trusted").is_dir():
            raise AccessError(f"{file}: is in no `rejected` folder; say with --pki which list is meant")
        pki = inferred.parent
    check_directory(pki, AccessError)
    target = pki / "trusted" / f"{thumbprint(der(certificate))}.der"
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(der(certificate))
        if inferred == (pki / "rejected").resolve():
            file.unlink()
    except OSError as error:
        raise AccessError(f"{target}: {error.strerror}") from error
    print_result(f"{certificate.subject.rfc4514_string()} is trusted: {target}")


def list_certs(pki: Path) -> None:
    """List certificates of a trust list, folder by folder.

    Raises
    ------
    AccessError
        The directory is absent, or a file.
    """
    kind = kind_of(pki, AccessError)
    if kind is Kind.FILE:
        raise AccessError(f"{pki}: is a file; name the directory that holds own, trusted and rejected")
    if kind is Kind.NOTHING:
        raise AccessError(f"{pki}: is not there; make it with `impactcell certs make {pki}`")
    now = datetime.now(UTC)
    for folder in FOLDERS:
        for path in sorted((pki / folder).glob("*")):
            if path.name == KEY or path.name.startswith("."):
                continue
            try:
                certificate = read_certificate(path)
            except AccessError as error:
                if folder != "revoked":
                    _say(f"{folder:9} cannot be used: {error}")
                elif not is_revocation_list(path):
                    _say(f"{folder:9} cannot be used: {path}: no revocation list in PEM or DER")
                continue
            until = f"{certificate.not_valid_after_utc:%Y-%m-%d}"
            subject = certificate.subject.rfc4514_string()
            mark = validity_mark(certificate, now)
            _say(f"{folder:9} {until} {thumbprint(der(certificate))} {subject}{mark and f' ({mark})'}")
            if folder == "rejected":
                _say(f"          trust it with: impactcell certs trust '{path}'")


def _say(text: str = "") -> None:
    sys.stdout.write(f"{text}\n")
