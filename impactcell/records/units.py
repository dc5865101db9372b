"""What people write, in SI units."""

from typing import Final

MM_PER_MIN: Final = 1e-3 / 60.0
"""One millimetre per minute [m/s]."""
