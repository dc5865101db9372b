"""English of the workflow as patterns, and how a text that they know is said in German."""

import re
from collections.abc import Callable, Sequence

from impactcell.german.findings import with_decimal_commas

Patterns = Sequence[tuple[str, str | Callable[[re.Match[str]], str]]]
"""English as a pattern, and German as that is expanded; a function gives nothing where it knows no part."""


def marked(english: str, german: str | None) -> tuple[str, str]:
    """Give the language of a text, and the text: English where it has no German."""
    return ("en", english) if german is None else ("de", with_decimal_commas(german))


def translated(english: str, patterns: Patterns) -> str | None:
    """Say a text whole, or else part by part; None where one of its parts is not known."""
    for pattern, german in patterns:
        if match := re.fullmatch(pattern, english, re.DOTALL):
            return (match.expand(german) if isinstance(german, str) else german(match)) or None
    first, separator, rest = english.partition("; ")
    if not separator:
        return None
    parts = translated(first, patterns), translated(rest, patterns)
    return None if None in parts else "; ".join(map(str, parts))
