"""A benchmark's result: what is measured, its bar, what came out, and how sure that is."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """One table of results.

    Attributes
    ----------
    columns : sequence of str
        Usually what | bar | measured | interval.
    note : str
        How it was computed: sizes, seeds, machine-independent conditions.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""

    def markdown(self) -> str:
        """Write the table as GitHub-flavoured markdown, columns aligned for reading as plain text."""
        cells = [list(map(str, self.columns)), *(list(map(str, row)) for row in self.rows)]
        widths = [max(len(row[i]) for row in cells) for i in range(len(self.columns))]
        padded = [[cell.ljust(width) for cell, width in zip(row, widths, strict=True)] for row in cells]
        lines = ["| " + " | ".join(row) + " |" for row in padded]
        lines.insert(1, "|" + "|".join("-" * (w + 2) for w in widths) + "|")
        return "\n".join([f"### {self.title}", "", *lines, *(["", self.note] if self.note else [])]) + "\n"
