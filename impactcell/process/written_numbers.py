"""Numbers that a file has as text: what they were meant as, and how that is written."""

import re
from typing import Final

DECIMAL_POINT: Final = "decimals have a point, not a comma"
"""Way out of `1,5`, which is a text, or within braces a 1 and a key 5."""
_WITH_COMMA: Final = re.compile(r"[+-]?\d*,\d+")
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


def number_meant(value: object) -> str:
    """Say how a text is written so that it is a number; nothing of what is none.

    >>> number_meant("18,9"), number_meant("18.9"), number_meant("5 kg")
    ('decimals have a point, not a comma: 18.9', 'leave out the quotes: 18.9', '')
    """
    if not isinstance(value, str):
        return ""
    if _WITH_COMMA.fullmatch(value):
        return f"{DECIMAL_POINT}: {value.replace(',', '.')}"
    return f"leave out the quotes: {value}" if _NUMBER.fullmatch(value) else ""
