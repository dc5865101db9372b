"""impactcell: friction from taps, followed over wear, batch and stroke, and used to place parts."""

from importlib.metadata import version

__version__ = version("impactcell")
