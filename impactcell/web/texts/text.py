"""What a text is: the same in every language that the page speaks."""

from collections.abc import Mapping
from typing import Final

LANGUAGES: Final[Mapping[str, str]] = {"en": "English", "de": "Deutsch"}
"""Languages by their code, each by its own name; the first is taken where nothing else is asked for."""

Texts = Mapping[str, tuple[str, str]]
"""Texts by their key, one for each language, in their order."""
