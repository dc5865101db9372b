"""Write down every stored key: ``python -m tests.data.pin_stored_forms``, after a migration has its rows."""

import json
from pathlib import Path
from typing import Any

from impactcell.journal.stored_forms import ALARM, MODEL, STATE
from impactcell.serialization import described

PINNED = Path(__file__).with_name("stored-forms.json")


def forms() -> dict[str, Any]:
    """Stored form of all that a journal keeps, with its format number."""
    return {form.what: {"format": form.format, **described(form.kind)} for form in (STATE, ALARM, MODEL)}


if __name__ == "__main__":
    PINNED.write_text(json.dumps(forms(), indent=1) + "\n", encoding="utf-8")
