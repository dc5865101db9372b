"""A service that ends with entries that no journal could take has an exit code of its own."""

import asyncio
from typing import TYPE_CHECKING, cast

import pytest

from impactcell.process.exit_codes import ExitCode, exit_code_of
from impactcell.service.service import Service

if TYPE_CHECKING:
    from impactcell.service.cell_task import CellTask


class Ended:
    """A cell's task, whose journal could not take so many entries at the end."""

    def __init__(self, lost: int) -> None:
        self._lost = lost

    async def close(self) -> int:
        return self._lost


async def ended_with(*lost: int) -> None:
    service, stop = Service([]), asyncio.Event()
    service.running.update({f"cell-{n}": cast("CellTask", Ended(count)) for n, count in enumerate(lost)})
    stop.set()
    await service.run(stop)


@pytest.mark.parametrize(
    ("lost", "code"), [((0, 0), ExitCode.DONE), ((0, 2), ExitCode.LOST), ((18, 2), ExitCode.LOST)]
)
def test_it_tells_by_its_exit_code(
    lost: tuple[int, ...], code: ExitCode, capsys: pytest.CaptureFixture[str]
) -> None:
    """It ended with 0, as if all were stored."""
    assert exit_code_of("impactcell", lambda: asyncio.run(ended_with(*lost))) == code
    told = f"impactcell: entries that no journal could take: {sum(lost)}; the log says why\n"
    assert capsys.readouterr().err == (told if sum(lost) else "")
