"""Foreign programs: a small server compiled against libmodbus."""

import shutil
import subprocess
from collections.abc import Iterator
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


@pytest.fixture
def libmodbus_port(libmodbus_program: Path) -> Iterator[int]:
    with subprocess.Popen(
        [libmodbus_program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        yield int(process.stdout.readline())
        process.terminate()
