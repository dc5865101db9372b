"""The table of how the tree is built."""

from tests.benchmarks.structure import tables


def measured() -> str:
    """Write the table without its heading; the page has one."""
    (structure,) = tables()
    return structure.markdown().split("\n", 2)[2]
