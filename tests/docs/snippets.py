"""Pages as programs: the blocks of a page in their order, and what each is said to print."""

import contextlib
import io
import os
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.integration.shell_commands import shell_commands

FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Snippet:
    """One block of Python or shell, and the text block that follows it, if that stands right below."""

    language: str
    code: str
    line: int
    printed: str | None


def snippets(page: Path) -> list[Snippet]:
    """Give the blocks `python` and `sh` of a page."""
    text = page.read_text(encoding="utf-8")
    blocks = list(FENCE.finditer(text))
    found = []
    for number, block in enumerate(blocks):
        if block[1] not in {"python", "sh"}:
            continue
        after = blocks[number + 1] if number + 1 < len(blocks) else None
        follows = after is not None and after[1] == "text" and not text[block.end() : after.start()].strip()
        line = text.count("\n", 0, block.start()) + 2
        found.append(Snippet(block[1], block[2], line, after[2] if follows and after else None))
    return found


def run(page: Path, directory: Path) -> list[tuple[Snippet, str]]:
    """Run the blocks of a page in a directory, in one program; return each with what it printed."""
    names: dict[str, Any] = {"__name__": page.stem}
    commands = directory / ".commands"
    with contextlib.chdir(directory), shell_commands(commands):
        return [
            (block, _python(block, page, names) if block.language == "python" else _shell(block, commands))
            for block in snippets(page)
        ]


def _python(block: Snippet, page: Path, names: dict[str, Any]) -> str:
    # Blank lines before it, so that a traceback names the line of the page.
    code = compile("\n" * (block.line - 1) + block.code, str(page), "exec")
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(code, names)
    return printed.getvalue()


def _shell(block: Snippet, commands: Path) -> str:
    path = f"{commands}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euc", block.code],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PATH": path},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
