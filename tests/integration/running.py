"""A process that a test follows, however it was started."""

import asyncio
import re
from dataclasses import dataclass, field
from typing import Protocol

from tests.patience import COMPILING_S


class AnyProcess(Protocol):
    """What a test needs of a process."""

    @property
    def returncode(self) -> int | None: ...
    def kill(self) -> None: ...
    def terminate(self) -> None: ...
    async def wait(self) -> int | None: ...


@dataclass
class Running:
    """A process with the lines it wrote to standard error."""

    process: AnyProcess
    output: asyncio.StreamReader | None = None
    lines: list[str] = field(default_factory=list)
    news: asyncio.Condition = field(default_factory=asyncio.Condition)

    async def line(self, pattern: str, timeout_s: float = COMPILING_S) -> re.Match[str]:
        """Wait for a line of standard error."""

        def found() -> re.Match[str] | None:
            return next((m for text in self.lines if (m := re.search(pattern, text))), None)

        async with asyncio.timeout(timeout_s), self.news:
            await self.news.wait_for(lambda: found() or self.process.returncode is not None)
        match = found()
        assert match, f"no line with {pattern!r} in:\n" + "\n".join(self.lines)
        return match

    async def follow(self, errors: asyncio.StreamReader) -> None:
        """Take what the process writes to standard error, up to its end."""
        async for line in errors:
            async with self.news:
                self.lines.append(line.decode().rstrip())
                self.news.notify_all()
        await self.process.wait()
        async with self.news:
            self.news.notify_all()
