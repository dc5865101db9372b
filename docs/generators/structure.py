"""The tables of how the tree is built."""

from tests.benchmarks.structure import tables


def measured() -> str:
    """Write the tables, the first without its heading; the page has one."""
    structure, *lines = tables()
    return "\n".join(
        [
            structure.markdown().split("\n", 2)[2],
            *(table.markdown().replace("###", "##", 1) for table in lines),
        ]
    )
