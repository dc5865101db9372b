"""The users file: who may log in, with which password or certificate, in which role.

A YAML file that only its owner can read::

    users:
    - name: ops
      role: operator
      password: $argon2id$v=19$m=19456,t=2,p=1$...
    - name: press-line
      role: observer
      certificate: 5F2D...          # SHA-256 fingerprint of the user's certificate
"""

import logging
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import yaml
from argon2 import PasswordHasher
from argon2.exceptions import Argon2Error, InvalidHashError

from impactcell.errors import AccessError, SettingsError
from impactcell.opcua.host_interface import RegisteredUser, Role
from impactcell.process import yaml_loader
from impactcell.process.path_kind import Kind, kind_at
from impactcell.process.whole_files import write_whole

_log = logging.getLogger(__name__)

# OWASP's first recommendation for argon2id: 19 MiB, 2 passes, 1 lane.
_HASHER: Final = PasswordHasher(time_cost=2, memory_cost=19_456, parallelism=1)
_UNKNOWN: Final = (
    "$argon2id$v=19$m=19456,t=2,p=1$bm9ib2R5a25vd3NpdA$YzE0ZGQ2ZDYzZjI2ZTQ2MmI1ZGFkYjE5ZTQ0ZWYyZDQ"
)
"""A hash no password fits: an unknown name takes as long as a wrong password."""


@dataclass(frozen=True, slots=True)
class User:
    """One entry of the users file."""

    name: str
    role: Role
    password: str | None = None
    certificate: str | None = None


def read_users(path: Path) -> dict[str, User]:
    """Read a users file; an absent file holds nobody.

    Raises
    ------
    AccessError
        The file cannot be read or is not a users file; the message names the entry.
    """
    try:
        kind = kind_at(path)
    except OSError as error:  # what may not be looked at holds nobody who may log in, and is told
        told = f"cannot be read: {error.strerror}; let who runs this read it, or name another"
        raise AccessError(f"{path}: {told}") from error
    if kind is Kind.NOTHING:
        return {}
    way_out = f"move it away, and make one with `impactcell users add {shlex.quote(str(path))} NAME`"
    if kind is Kind.DIRECTORY:
        raise AccessError(f"{path}: is a directory, where a users file is needed; name a file in it")
    try:
        data, _ = yaml_loader.load(path)
    except SettingsError as error:
        raise AccessError(f"{error}; a users file is needed: correct it, or {way_out}") from error
    entries = data.get("users") if isinstance(data, dict) else None
    if not isinstance(entries, list):
        raise AccessError(f"{path}: not a users file; {way_out}")
    users: dict[str, User] = {}
    for number, entry in enumerate(entries, 1):
        user = _user(entry, f"{path}: user {number}")
        if user.name in users:
            raise AccessError(f"{path}: user {number}: {user.name!r} is there twice")
        users[user.name] = user
    return users


def _user(entry: object, where: str) -> User:
    if not isinstance(entry, dict) or not isinstance(entry.get("name"), str) or not entry["name"]:
        raise AccessError(f"{where}: has no name")
    unknown = set(entry) - {"name", "role", "password", "certificate"}
    if unknown:
        raise AccessError(f"{where}: does not know {', '.join(sorted(map(str, unknown)))}")
    roles = {role.name.lower(): role for role in Role}
    role = entry.get("role")
    if not isinstance(role, str) or role not in roles:
        raise AccessError(f"{where}: the role is one of {', '.join(roles)}")
    password, certificate = entry.get("password"), entry.get("certificate")
    if not isinstance(password, str | None) or not isinstance(certificate, str | None):
        raise AccessError(f"{where}: password and certificate are text")
    if password is None and certificate is None:
        raise AccessError(f"{where}: has neither password nor certificate")
    return User(entry["name"], roles[role], password, certificate)


def write_users(path: Path, users: dict[str, User]) -> None:
    """Replace a users file in one step; only its owner can read it.

    Raises
    ------
    AccessError
        The file cannot be written.
    """
    entries = [
        {
            key: value
            for key, value in (
                ("name", user.name),
                ("role", user.role.name.lower()),
                ("password", user.password),
                ("certificate", user.certificate),
            )
            if value is not None
        }
        for user in users.values()
    ]
    text = yaml.safe_dump({"users": entries}, sort_keys=False, allow_unicode=True)
    try:
        write_whole(path, text, private=True)
    except OSError as error:
        raise AccessError(f"{path}: cannot be written: {error.strerror}") from error


def with_password(user: User, password: str) -> User:
    """Give a user a password, which is kept as an argon2id hash only."""
    return replace(user, password=_HASHER.hash(password))


def verify(user: User | None, password: str) -> bool:
    """Check a password; takes as long for a user who does not exist."""
    known = user.password if user is not None and user.password is not None else _UNKNOWN
    try:
        return _HASHER.verify(known, password)
    except (Argon2Error, InvalidHashError):
        return False


class Users:
    """The users file as it is now, read anew whenever it has changed; implements `opcua.UserDirectory`."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._stamp: tuple[int, int, int] | None = None
        self._users: dict[str, User] = {}
        self.current()

    def current(self) -> dict[str, User]:
        """Users of the file, by name.

        Raises
        ------
        AccessError
            The file has become unreadable; nobody may log in until it is mended.
        """
        try:
            status = self._path.stat()
            stamp: tuple[int, int, int] | None = (status.st_mtime_ns, status.st_size, status.st_ino)
        except OSError:
            stamp = None
        if stamp != self._stamp or stamp is None:
            self._users = read_users(self._path)
            self._stamp = stamp
        return self._users

    def find(self, name: str) -> User | None:
        """Find a user; nobody is found while the file cannot be read."""
        return self._readable().get(name)

    def find_by_certificate(self, fingerprint: str) -> User | None:
        """Find the user a certificate belongs to."""
        for user in self._readable().values():
            if user.certificate is not None and user.certificate.upper() == fingerprint:
                return user
        return None

    @staticmethod
    def verify_password(user: RegisteredUser | None, password: str) -> bool:
        """Check a password; takes as long for a user who does not exist."""
        return verify(user if isinstance(user, User) else None, password)

    def _readable(self) -> dict[str, User]:
        try:
            return self.current()
        except AccessError as error:
            _log.error("nobody can log in: %s", error)
            return {}
