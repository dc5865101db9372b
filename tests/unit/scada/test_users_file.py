"""Files of users that are none: each is refused in a sentence that says where."""

import errno
import os
import re
from pathlib import Path

import pytest

from impactcell.errors import AccessError
from impactcell.scada import Role
from impactcell.scada.users import User, Users, read_users, write_users

ENTRY = "name: eve, role: observer, password: x"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("users: [\n", r"users\.yaml:2:1: "),
        ("users: !!timestamp 2026-13-45\n", r"users\.yaml:1:8: '2026-13-45' cannot be read as timestamp"),
        ("users: !!bool maybe\n", r"users\.yaml:1:8: 'maybe' cannot be read as bool"),
        ("users: " + "[" * 5000, r"users\.yaml:1:1: nested too deeply"),
        ("users: 3\n", "not a users file; move it away, and make one with `impactcell users add /"),
        ("users: [3]\n", "user 1: has no name"),
        ("users: [{name: eve, role: [observer], password: x}]\n", "user 1: the role is one of"),
        ("users: [{name: eve, role: !!binary QQ==, password: x}]\n", "user 1: the role is one of"),
        ("users: [{name: eve, role: observer, password: 5}]\n", "user 1: password and certificate are text"),
        (f"users: [{{{ENTRY}}}, {{{ENTRY}}}]\n", "user 2: 'eve' is there twice"),
        (f"users: [{{{ENTRY}, password: y}}]\n", r"users\.yaml:1:\d+: key 'password' is given twice"),
    ],
)
def test_what_is_no_users_file_is_told_with_its_place(text: str, told: str, tmp_path: Path) -> None:
    file = tmp_path / "users.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(AccessError, match=told):
        read_users(file)


def test_a_file_that_nobody_may_look_at_is_told_and_lets_nobody_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    file = tmp_path / "users.yaml"
    write_users(file, {"eva": User("eva", Role.ENGINEER, "x")})
    users, look = Users(file), Path.stat

    def stat(path: Path, *, follow_symlinks: bool = True) -> os.stat_result:
        if path == file:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return look(path, follow_symlinks=follow_symlinks)

    told = f"{file}: cannot be read: Permission denied; let who runs this read it, or name another"
    with monkeypatch.context() as barred:
        barred.setattr(Path, "stat", stat)
        with pytest.raises(AccessError, match=re.escape(told)):
            read_users(file)
        assert (users.find("eva"), users.find_by_certificate("AB")) == (None, None)
    assert [record.message for record in caplog.records] == [f"nobody can log in: {told}"] * 2
    assert users.find("eva") is not None


def test_nobody_is_in_a_file_that_is_not_there(tmp_path: Path) -> None:
    assert read_users(tmp_path / "users.yaml") == {}
