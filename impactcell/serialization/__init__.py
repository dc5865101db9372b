"""Frozen dataclasses written down and read back to the same bits, in a form that outlives their names.

::

    dataclass ── tree ──► bytes (MessagePack: small and fast, for the state of each cycle)
                  │  └──► text (JSON: for what people may look at)
                  └── a format number, and migrations from every older one (`versioned`)

A tree is dicts, lists, numbers, strings and float64 arrays. A class's name is not in it: renaming or moving a
class changes nothing. A field's key is the field's name, unless the field declares another::

    clock: Clock = field(default_factory=Clock, metadata=stored(key="cycle_clock"))

So a field that is renamed takes one line: that declaration, or, where the old name is to be forgotten, a row
in the rename table of the migration (`impactcell.journal.migrations`). A test pins every stored key
(tests/data/stored-forms.json) and says what to do.
"""

from impactcell.serialization.json_text import dumps, loads
from impactcell.serialization.message_pack import pack, unpack
from impactcell.serialization.stored_form import described, stored
from impactcell.serialization.versioned import Migration, Versioned

__all__ = ["Migration", "Versioned", "described", "dumps", "loads", "pack", "stored", "unpack"]
