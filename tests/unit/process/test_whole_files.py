"""What is written appears whole or not at all, and leaves nothing beside it."""

import os
import stat
from pathlib import Path

import pytest

from impactcell.process.whole_files import directory_beside, write_whole


def test_a_file_takes_the_place_of_the_one_before(tmp_path: Path) -> None:
    path = tmp_path / "users.yaml"
    path.write_text("before", encoding="utf-8")
    path.chmod(0o644)
    write_whole(path, "now", private=True)
    assert path.read_text(encoding="utf-8") == "now"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    mask = os.umask(0o027)
    try:
        write_whole(path, "again")
    finally:
        os.umask(mask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_moved_is_removed(tmp_path: Path) -> None:
    place = tmp_path / "model.yaml"
    place.mkdir()
    with pytest.raises(OSError, match="directory"):
        write_whole(place, "text")
    assert list(tmp_path.iterdir()) == [place]
    with pytest.raises(OSError, match="No such file"):
        write_whole(tmp_path / "absent" / "model.yaml", "text")


def test_a_directory_that_is_given_up_leaves_nothing(tmp_path: Path) -> None:
    def fill() -> None:
        with directory_beside(tmp_path / "a" / "b") as beside:
            (beside / "half").write_text("half", encoding="utf-8")
            raise OSError("full")

    with pytest.raises(OSError, match="full"):
        fill()
    assert list((tmp_path / "a").iterdir()) == []
