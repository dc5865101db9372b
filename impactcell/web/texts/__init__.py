"""Every text of the page, in every language that it speaks: one catalogue."""

from typing import Final

from impactcell.web.texts.pages import PAGE_TEXTS
from impactcell.web.texts.script import SCRIPT_TEXTS
from impactcell.web.texts.studies import STUDY_TEXTS
from impactcell.web.texts.text import LANGUAGES, Texts

CATALOGUE: Final[Texts] = {**PAGE_TEXTS, **STUDY_TEXTS, **SCRIPT_TEXTS}
"""All texts; those that begin with `live_` are for the script."""

__all__ = ["CATALOGUE", "LANGUAGES", "Texts"]
