"""Order of names with numbers in them, as people count."""

import re


def natural_key(name: str) -> list[tuple[int, int, str]]:
    """Key under which `shot10` comes after `shot9`.

    Examples
    --------
    >>> sorted(["shot10", "shot9"], key=natural_key)
    ['shot9', 'shot10']
    """
    return [
        (0, int(part), "") if part.isdigit() and part.isascii() else (1, 0, part)
        for part in re.split(r"(\d+)", name)
    ]
