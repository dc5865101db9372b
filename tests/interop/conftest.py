"""Foreign programs: a small server compiled against libmodbus."""

import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

SOURCE = Path(__file__).parent / "libmodbus" / "server.c"


@pytest.fixture(scope="session")
def libmodbus_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("gcc") is None or shutil.which("pkg-config") is None:
        pytest.skip("gcc or pkg-config is not installed")
    found = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "libmodbus"], capture_output=True, text=True, check=False
    )
    if found.returncode:
        pytest.skip("libmodbus-dev is not installed")
    program = tmp_path_factory.mktemp("libmodbus") / "server"
    subprocess.run(["gcc", "-O2", "-o", program, SOURCE, *found.stdout.split()], check=True)
    return program


LibmodbusServer = Callable[..., AbstractContextManager[str]]
"""Runs the server, on TCP or on the serial device that is named; gives its port, or the device."""


@pytest.fixture
def libmodbus_server(libmodbus_program: Path) -> LibmodbusServer:
    @contextmanager
    def running(*device: str) -> Iterator[str]:
        with subprocess.Popen(
            [libmodbus_program, *device], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout is not None
            try:
                yield process.stdout.readline().strip()
            finally:
                process.terminate()

    return running


@pytest.fixture
def libmodbus_port(libmodbus_server: LibmodbusServer) -> Iterator[int]:
    with libmodbus_server() as port:
        yield int(port)
