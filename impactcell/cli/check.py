"""`impactcell check`: every fault of the cell files, and whether each cell fits together as a whole."""

import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from impactcell.errors import SettingsError
from impactcell.process.console import print_note, print_result
from impactcell.settings import read_cells
from impactcell.settings.judgement import judge_cell

_PLACED = re.compile(r"(?P<file>.+?):(?P<line>\d+):(?P<column>\d+): (?P<message>.*)")
"""How a fault with a place is written."""


def check(cells: Sequence[Path], *, as_json: bool = False) -> None:
    """Report every fault at once; notes are told, and are none.

    Raises
    ------
    SettingsError
        A file is at fault, or a cell does not fit together.
    """
    faults, notes = "", []
    try:
        for cell in read_cells(cells):
            for finding in judge_cell(cell):
                if finding.is_fault:
                    faults += f"{finding}\n"
                else:
                    notes.append(str(finding))
    except SettingsError as error:
        faults = str(error)
    if as_json:
        content = {
            "cells": [str(cell) for cell in cells],
            "faults": [_parsed(line) for line in faults.splitlines()],
            "notes": [_parsed(line) for line in notes],
        }
        sys.stdout.write(json.dumps(content, ensure_ascii=False) + "\n")
    for note in notes:
        print_note(note)
    if faults:
        raise SettingsError(faults.strip())
    if not as_json:
        print_result(f"{len(cells)} cell file{'s' * (len(cells) > 1)} in order")


def _parsed(line: str) -> dict[str, str | int | None]:
    placed = _PLACED.fullmatch(line)
    if placed is None:
        return {"file": None, "line": None, "column": None, "message": line}
    message = placed["message"].removeprefix("note: ")
    place = {"file": placed["file"], "line": int(placed["line"]), "column": int(placed["column"])}
    return {**place, "message": message}
