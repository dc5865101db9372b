"""A new rule is one file, that of the page: beside the others it is asked, stored, configured, published."""

import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import impactcell
from impactcell.alarms import rules
from impactcell.scada.german import GERMAN
from tests.docs.snippets import snippets

TREE = Path(impactcell.__file__).parents[1]
RULE = snippets(TREE / "docs" / "how-to" / "alarm-rule.md")[0].code
SEEN = """
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

from impactcell import alarms
from impactcell.journal.stored_forms import ALARM, load_alarm
from impactcell.scada.german import GERMAN
from impactcell.scada.nodeset import nodeset
from impactcell.serialization import pack, unpack
from impactcell.service.factory import cell_design
from impactcell.settings import read_cell
from tests.snapshots import make_capture, make_snapshot

settings = alarms.AlarmSettings()
state = alarms.initial_state(settings)
wear = replace(make_snapshot(make_capture()).wear, level=0.2, level_std=0.001)
raised, told = [], set()
for cycle in range(1, 36):
    friction = make_snapshot(make_capture(), mu_s=0.4 + 1e-5 * cycle).friction
    inputs = alarms.CycleInputs(cycle, wear, friction=friction, false_alarm_cycles=1e5, period_s=1.0)
    results = alarms.evaluate(settings, state, inputs)
    state, transitions = alarms.update(settings, state, results, cycle, cycle * 10**9)
    raised += [t.alarm for t in transitions if t.alarm.name == "Sticky"]
    told |= {state.alarm("Sticky").evidence.size}
(alarm,) = raised
assert (alarm.severity, alarm.cycle, alarm.evidence.change_cycle) == (450, 2, 2), alarm
assert (alarm.message, alarm.message_de) == ("The part sticks: clean it.", "Das Teil klebt: reinigen."), alarm
assert abs(alarm.evidence.statistic - 2.0001) < 1e-12 and alarm.evidence.false_alarm_cycles == 1e5
assert sum(size == size for size in told) == 1, "an event every cycle"
assert pack(unpack(alarms.AlarmSetState, pack(state))) == pack(state)
assert load_alarm(ALARM.dumps(alarm)).message_de == alarm.message_de
assert GERMAN["The part sticks."] == "Das Teil klebt."
names = {e.get("BrowseName") for e in ElementTree.fromstring(nodeset())}
assert {"1:Sticky", "1:StickyAlarmType"} <= names, sorted(filter(None, names))

cell = read_cell(Path(sys.argv[1]))
section = cell.settings.alarms.model_copy(update={"on_delay_cycles": 7})
cell = replace(cell, settings=cell.settings.model_copy(update={"alarms": section}))
rule = cell_design(cell).alarms.rule("Sticky")
assert (rule.severity, rule.on_delay, rule.off_delay, rule.activate_above) == (450, 7, 2, 1.5), rule
"""


def run(tree: Path, *arguments: str) -> None:
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_a_rule_is_one_file(tmp_path: Path) -> None:
    for package in ("impactcell", "tests"):
        # Machine code comes along: what is not changed is not compiled anew.
        ignored = shutil.ignore_patterns("node", "node_modules")
        shutil.copytree(TREE / package, tmp_path / package, ignore=ignored)
    (tmp_path / "impactcell" / "alarms" / "rules" / "sticky.py").write_text(RULE, encoding="utf-8")
    shutil.copy2(TREE / "pyproject.toml", tmp_path)
    run(tmp_path, "-c", SEEN, str(TREE / "config" / "cells" / "prototype.yaml"))
    run(tmp_path, "-m", "impactcell.scada.nodeset")
    run(
        tmp_path,
        *("-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider"),
        "tests/unit/alarms/test_alarm_set.py",
        "tests/unit/scada/test_model.py",
        "tests/integration/test_opcua_languages.py",
    )


def test_every_rule_lies_in_a_file_of_its_name() -> None:
    for module in pkgutil.iter_modules(rules.__path__):
        declared = importlib.import_module(f"{rules.__name__}.{module.name}").RULE
        assert "".join(part.capitalize() for part in module.name.split("_")) == declared.name
    numbers = [n for rule in rules.RULES.values() for n in (rule.node_number, rule.type_number)]
    assert len(set(numbers)) == len(numbers)


def test_every_rule_speaks_both_languages() -> None:
    for rule in rules.RULES.values():
        assert GERMAN[rule.description.english] == rule.description.german != rule.description.english
        assert rule.title.text("de-AT") == rule.title.german != rule.title.text("en")
        assert rule.title.text("fr") == rule.title.english
