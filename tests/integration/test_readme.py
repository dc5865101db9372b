"""Every command of the README does what it says, in a copy of the checkout."""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.integration.shell_commands import shell_commands

ROOT = Path(__file__).resolve().parents[2]
COPIED = (
    "config",
    "tests",
    "Makefile",
    "pyproject.toml",
    "requirements.lock",
    "README.md",
    "docs",
)
UNTIL_CONNECTED = """
: > {log}
{service} 2> {log} & service=$!
until grep -q "connected to" {log}; do kill -0 $service || {{ cat {log} >&2; exit 1; }}; sleep 0.1; done
kill -TERM $service
wait $service || {{ cat {log} >&2; exit 1; }}
cat {log} >&2
"""
"""The service runs until it is told to stop: it is told once it has shown itself."""
ELSEWHERE = {
    "make demo": "tried below with its own arguments; without an end it runs until Ctrl-C",
    "make test": "is what runs this test",
}


def blocks() -> list[str]:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = re.findall(r"```sh\n(.*?)```", text, flags=re.DOTALL)
    return [re.sub(r"^ {3}", "", block, flags=re.MULTILINE) for block in found]


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("checkout")
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            ignored = shutil.ignore_patterns("node_modules", "_build", "_generated")
            shutil.copytree(source, directory / name, ignore=ignored)
        else:
            shutil.copy2(source, directory / name)  # make looks at the times
    # The program itself is no copy: beside one, all machine code would be compiled a second time.
    for name in ("impactcell", "simulator", ".venv"):
        (directory / name).symlink_to(ROOT / name)
    cell = directory / "config" / "cells" / "prototype.yaml"  # another test may be at the usual port
    with cell.open("a", encoding="utf-8") as file:
        file.write("opcua:\n  endpoint: opc.tcp://127.0.0.1:0/impactcell\n")
    campaign = directory / "config" / "sim" / "campaign.yaml"  # the same in less time, with half the shots
    text = campaign.read_text(encoding="utf-8")
    assert text.count("replicates: 2") == 1
    campaign.write_text(text.replace("replicates: 2", "replicates: 1"), encoding="utf-8")
    return directory


@pytest.mark.long
def test_the_commands_in_their_order(checkout: Path, tmp_path: Path) -> None:
    lines = [line for block in blocks() for line in block.splitlines() if line.strip() not in ELSEWHERE]
    script = "set -eu\ntrap 'kill $(jobs -p) 2>/dev/null || true' EXIT\n" + "\n".join(lines)
    script = script.replace("/tmp/", f"{tmp_path}/")
    service = ".venv/bin/impactcell run config/cells/prototype.yaml"
    assert script.count(service) == 1
    # The service is a process of its own; what is not looked at as a process is forked off.
    script = re.sub(r"\.venv/bin/(?=impactcell|python)", "commands/", script)
    script = script.replace(
        service.replace(".venv/bin", "commands"),
        UNTIL_CONNECTED.format(service=service, log=tmp_path / "run.log"),
    )
    with shell_commands(checkout / "commands"):
        done = subprocess.run(
            ["bash", "-c", script],
            cwd=checkout,
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "PYTHONPATH": str(checkout)},
        )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "connected to 127.0.0.1:15020" in done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "discrepancy" / "report.html").is_file()
    promised = re.search(
        r"`(Missing: .*?) falls", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL
    )
    assert promised is not None
    assert " ".join(promised[1].split()) in done.stdout
    rows = (tmp_path / "estimates.csv").read_text().splitlines()[1:]
    assert len(rows) > 10
    assert all(",uncertain," in row for row in rows)
    assert sum("the model misses" in row for row in rows) > 0.9 * len(rows)


def test_the_notebook_lines_run(tmp_path: Path) -> None:
    (code,) = re.findall(
        r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.DOTALL
    )
    names: dict[str, object] = {}
    exec(code, names)
    assert abs(names["friction"].mu_k.value - 0.16) < 1e-3
    assert names["series"].used == 3
    assert names["action"].velocity_m_s > 0.0


def test_every_link_leads_somewhere() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", text):
        assert (ROOT / target).exists(), target


@pytest.mark.slow
def test_the_demo_sums_up(checkout: Path) -> None:
    # As from a shell: a make within a make would add lines of its own.
    plain = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    done = subprocess.run(
        ["make", "demo", "ARGS=--cycles 30 --json"],
        cwd=checkout,
        capture_output=True,
        text=True,
        check=False,
        env=plain,
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout.splitlines()[-1])
    assert summary["cycles"] == 30
    assert summary["missed"] == 0
    assert summary["mu_s"] == pytest.approx(0.2, rel=0.15)
    assert summary["batch"]["id"] in {"B", "C"}
    assert any(alarm["alarm"] == "DeviantCycle" for alarm in summary["alarms"]), summary
