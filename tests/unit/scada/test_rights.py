"""The rights matrix against the words of the interface, and against the printed documentation."""

from pathlib import Path

import pytest

from impactcell.scada import Permission, Role
from impactcell.scada.rights import MATRIX, Area, allowed, matrix_table

README = Path(__file__).resolve().parents[3] / "impactcell" / "scada" / "README.md"

OBSERVER = {(a, r) for a, r in MATRIX if r is not Permission.WRITE and r is not Permission.CALL} | {
    (Area.REFRESH, Permission.CALL)
}
OPERATOR = OBSERVER | {
    (area, Permission.CALL)
    for area in (
        Area.ACKNOWLEDGE,
        Area.CONFIRM,
        Area.COMMENT,
        Area.SHELVE,
        Area.START_BATCH,
        Area.ABORT_POSITIONING,
    )
}
ENGINEER = OPERATOR | {(area, Permission.CALL) for area in (Area.SET_TARGET, Area.RESET_WEAR, Area.ENABLE)}


@pytest.mark.parametrize(
    ("role", "may"), [(Role.OBSERVER, OBSERVER), (Role.OPERATOR, OPERATOR), (Role.ENGINEER, ENGINEER)]
)
def test_roles_may_what_the_interface_says(role: Role, may: set[tuple[Area, Permission]]) -> None:
    assert {cell for cell in MATRIX if allowed(role, *cell)} == may


def test_what_the_table_does_not_name_is_refused() -> None:
    assert not allowed(Role.ENGINEER, Area.RESET_WEAR, Permission.WRITE)


def test_the_documentation_prints_this_table() -> None:
    assert matrix_table() in README.read_text()
