"""A campaign as a zip file, unpacked with nothing believed of what the archive says of itself."""

import re
import zipfile
import zlib
from pathlib import Path, PurePosixPath
from typing import Final

from impactcell.errors import CampaignError

MAX_MEMBERS: Final = 5000
"""Files of an archive: more shots than any campaign has."""
MAX_UNPACKED_BYTES: Final = 1_000_000_000
"""All members together."""
MAX_RATIO: Final = 200
"""An archive grows by at most so much: numbers as text are packed to a tenth, a bomb to a thousandth."""
FREE_BYTES: Final = 10_000_000
"""Up to this size no ratio counts."""
CHUNK_BYTES: Final = 1 << 18
"""Unpacked at a time."""
_CAMPAIGN_FILE: Final = re.compile(r"campaign\.yaml|shots\.csv|traces/[0-9]{1,9}\.csv")


def holds_campaign(archive: Path) -> bool:
    """Whether a zip file holds a campaign directory.

    Raises
    ------
    CampaignError
        It cannot be read.
    """
    with _opened(archive) as opened:
        return _root(opened) is not None


def unpack_campaign(archive: Path, directory: Path) -> None:
    """Write the campaign of an archive into a new directory; what is no part of a campaign is left out.

    Raises
    ------
    CampaignError
        It is damaged, encrypted, or too large once it is unpacked.
    """
    allowed = max(FREE_BYTES, min(MAX_UNPACKED_BYTES, MAX_RATIO * archive.stat().st_size))
    with _opened(archive) as opened:
        root = _root(opened)
        (directory / "traces").mkdir(parents=True)
        for member in opened.infolist():
            path = PurePosixPath(member.filename)
            if root is None or member.is_dir() or not path.is_relative_to(root):
                continue
            name = str(path.relative_to(root))
            if _CAMPAIGN_FILE.fullmatch(name):
                allowed -= _unpack(opened, member, directory / name, allowed)


def _opened(archive: Path) -> zipfile.ZipFile:
    try:
        opened = zipfile.ZipFile(archive)
    except (zipfile.BadZipFile, OSError, ValueError) as error:
        raise CampaignError(f"{archive.name}: is no zip file that can be read ({error})") from error
    if len(opened.infolist()) > MAX_MEMBERS:
        opened.close()
        raise CampaignError(f"{archive.name}: holds more than {MAX_MEMBERS} files")
    return opened


def _root(opened: zipfile.ZipFile) -> PurePosixPath | None:
    """Give the directory inside the archive that holds campaign.yaml, the uppermost; None for none."""
    paths = [PurePosixPath(member.filename) for member in opened.infolist()]
    roots = [path.parent for path in paths if path.name == "campaign.yaml" and ".." not in path.parts]
    return min(roots, key=lambda path: len(path.parts), default=None)


def _unpack(opened: zipfile.ZipFile, member: zipfile.ZipInfo, target: Path, allowed: int) -> int:
    place, size = f"{opened.filename and Path(opened.filename).name}: {target.name}", 0
    if member.flag_bits & 1:
        raise CampaignError(f"{place}: is encrypted; pack it without a password")
    try:
        with opened.open(member) as source, target.open("xb") as file:
            while chunk := source.read(CHUNK_BYTES):
                size += len(chunk)
                if size > allowed:
                    raise CampaignError(
                        f"{place}: grows too large; unpacked, an archive may have "
                        f"{MAX_UNPACKED_BYTES // 10**6} MB and {MAX_RATIO} times its own size"
                    )
                file.write(chunk)
    except FileExistsError as error:
        raise CampaignError(f"{place}: is there twice") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise CampaignError(f"{place}: is damaged ({error})") from error
    return size
