"""Signs of the page are in the fonts that people have; a box with nothing in it says nothing."""

from pathlib import Path

from matplotlib import get_data_path
from matplotlib.ft2font import FT2Font

import impactcell.web
from impactcell.web.texts import CATALOGUE

WEB = Path(impactcell.web.__file__).parent


def test_every_sign_has_a_glyph_in_a_common_font() -> None:
    """DejaVu Sans, which comes with matplotlib, stands in for all of them."""
    font = FT2Font(str(Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"))
    shown = "".join(
        path.read_text(encoding="utf-8")
        for path in (*WEB.glob("static/*.js"), *WEB.glob("static/*.css"), *WEB.glob("templates/*.j2"))
    )
    shown += "".join("".join(texts) for texts in CATALOGUE.values())
    assert not [sign for sign in set(shown) if sign.isprintable() and font.get_char_index(ord(sign)) == 0]
