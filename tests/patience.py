"""How long a test waits for what is to come.

Nothing is judged by it: these only end a test in which it never comes, on a machine that may be busy with
ten other things.
"""

from typing import Final

PATIENCE_S: Final = 600.0
"""For an answer."""
COMPILING_S: Final = 1500.0
"""For what a first start on a machine may have to compile, or for a whole study."""
