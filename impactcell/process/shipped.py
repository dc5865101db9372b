"""Files that come with the program: in `config/` of a checkout, in `share/` where it is installed."""

import sysconfig
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
"""Directory that holds the packages."""


def shipped_config(root: Path = ROOT) -> Path:
    """Find the directory with the cells, maps, models and scenarios that come with the program."""
    checkout = root / "config"
    if (checkout / "sim").is_dir():
        return checkout
    return Path(sysconfig.get_path("data")) / "share" / "impactcell" / "config"
