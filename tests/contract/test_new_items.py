"""What the pages say a new effect or a new published value takes is all of it: tried on a copy of the tree.

For an alarm rule `tests/unit/alarms/test_new_rule.py` does the same. In the copy the tests that know what
there is (of the library, the nodes, the stored columns) have to pass as they are.
"""

import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from impactcell.physics.effects import LIBRARY

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
EFFECT = '''
"""A constant force along +1."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, Kind, LawKind, Parameter, Phase


def pull(_a: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """P."""
    return p[0]


EFFECT = Effect(
    identifier="constant_pull",
    kind=Kind.BODY,
    equation="+P",
    reference="a weight on a string",
    meaning="Something pulls, always as much.",
    look_at="strings",
    phases=(Phase.FREE_SLIDE,),
    parameters=(Parameter("pull_n", "N", null=0.0, lower=-10.0, upper=10.0, typical=1.0),),
    laws={LawKind.BODY: pull},
)
'''
LAW = '''
"""A constant force along +1."""

from simulator.effects.law import Effect


class ConstantPull(Effect):
    """P."""

    identifier = "constant_pull"
    defaults = {"pull_n": 1.0}

    def __init__(self, pull_n: float) -> None:
        self._pull_n = pull_n

    def body_force(self, x: float, v: float, t: float) -> float:
        return self._pull_n
'''
END = ')\n"""Quantities that each cycle writes."""\n'
"""Of the table to which the page adds its row."""
LANGUAGES = (
    "tests/integration/test_opcua_languages.py::test_every_name_and_description_of_a_cell_is_there_in_german"
)


def blocks_of_the_page() -> list[str]:
    """The row of the table and the line of German that the how-to gives as its example."""
    page = (ROOT / "docs" / "how-to" / "published-value.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^   ```text\n(.*?)^   ```$", page, flags=re.DOTALL | re.MULTILINE)
    return [textwrap.indent(textwrap.dedent(block), "    ") for block in blocks]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for package in ("impactcell", "simulator", "tests", "config"):
        # Machine code comes along: what is not changed is not compiled anew.
        ignored = shutil.ignore_patterns("node", "node_modules")
        shutil.copytree(ROOT / package, tmp_path / package, ignore=ignored)
    shutil.copy2(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def run(copy: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def run_tests(copy: Path, *which: str) -> str:
    return run(copy, "-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider", *which)


def test_an_effect_is_one_file_and_one_independent_law(copy: Path) -> None:
    (copy / "impactcell" / "physics" / "effects" / "constant_pull.py").write_text(EFFECT, encoding="utf-8")
    contract = "tests/contract/test_effects.py"
    told = run_tests(copy, f"{contract}::test_it_says_what_it_is", f"{contract}::test_published_names_stay")
    assert f"{len(LIBRARY) + 2} passed" in told, told  # every effect, the new one, and the published names
    with pytest.raises(AssertionError, match="constant_pull"):
        run_tests(copy, "tests/unit/simulator/test_effects.py", "-k", "every_effect")
    (copy / "simulator" / "effects" / "constant_pull.py").write_text(LAW, encoding="utf-8")
    run_tests(copy, "tests/unit/simulator/test_effects.py", "-k", "every_effect or null")


def insert(path: Path, before: str, text: str) -> None:
    source = path.read_text(encoding="utf-8")
    assert source.count(before) == 1
    path.write_text(source.replace(before, text + before), encoding="utf-8")


def test_a_published_value_is_one_row_and_one_line_of_german(copy: Path) -> None:
    row, german = blocks_of_the_page()
    insert(copy / "impactcell" / "quantities.py", END, row)
    run(copy, "-m", "impactcell.scada.nodeset")
    with pytest.raises(AssertionError, match=r"say it in impactcell/scada/german_descriptions\.py: mu_s by"):
        run_tests(copy, LANGUAGES)
    first = '    "Adds a comment to the condition."'
    insert(copy / "impactcell" / "scada" / "german_descriptions.py", first, german)
    assert "CombinedFriction" in (copy / "impactcell/scada/model/ImpactCell.NodeSet2.xml").read_text(
        encoding="utf-8"
    )
    run_tests(
        copy,
        "tests/unit/scada/test_model.py",
        "tests/unit/journal/test_store.py",
        "tests/unit/journal/test_history.py",
        "tests/unit/journal/test_upgrade.py",
        "tests/integration/test_opcua_values.py::test_the_interface_is_there_with_units_and_descriptions",
        "tests/integration/test_opcua_values.py::test_status_value_and_time",
        "tests/integration/test_opcua_values.py::test_node_ids_stay_over_restarts_and_new_cells",
        "-k",
        "not killed",
        "tests/unit/web/test_listed_values.py",
        "impactcell/web/listed_values.py",
        LANGUAGES,
    )
    shown = "from impactcell.web.listed_values import listed_values as of; print(of('de')['Model'][-1].title)"
    assert run(copy, "-c", shown) == "µs nach (6)\n"
