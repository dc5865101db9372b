"""Files of users that are none: each is refused in a sentence that says where."""

from pathlib import Path

import pytest

from impactcell.errors import AccessError
from impactcell.scada.users import read_users

ENTRY = "name: eve, role: observer, password: x"


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


def test_nobody_is_in_a_file_that_is_not_there(tmp_path: Path) -> None:
    assert read_users(tmp_path / "users.yaml") == {}
