"""Built pages ask nothing of the outside: no script, style, font or picture from elsewhere."""

import re
from pathlib import Path

OUTSIDE = re.compile(r"""<(?:script|img|iframe|source|link)\b[^>]*?\b(?:src|href)=["'](?:https?:)?//[^"']*""")
IN_STYLE = re.compile(r"""(?:@import|url\()\s*["']?(?:https?:)?//[^"')]*""")


def outside_requests(pages: Path) -> list[str]:
    """Give what would be asked for elsewhere, with the file that asks."""
    asked = []
    for path in sorted(pages.rglob("*")):
        pattern = {".html": OUTSIDE, ".css": IN_STYLE}.get(path.suffix)
        if pattern is not None:
            text = path.read_text(encoding="utf-8")
            asked += [f"{path.relative_to(pages)}: {match[0]}" for match in pattern.finditer(text)]
    return asked
