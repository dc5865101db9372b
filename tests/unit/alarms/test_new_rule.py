"""A new rule is one file: copied beside the others it is asked, stored, configured and published."""

import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path

import impactcell
from impactcell.alarms import rules
from impactcell.scada.german import GERMAN

RULE = '''
"""Sticky: static friction is far above the level that wear explains."""

from impactcell.alarms.rule import AlarmRule, CycleInputs, Message, RuleContext, RuleResult, RuleSettings
from impactcell.records import Evidence

NAME = "Sticky"


def evaluate(inputs: CycleInputs, context: RuleContext) -> RuleResult:
    if inputs.friction is None:
        return RuleResult(NAME, None)
    ratio = inputs.friction.mu_s.value / inputs.wear.level
    if ratio <= context.threshold:
        return RuleResult(NAME, holds=False)
    return RuleResult(NAME, holds=True, message=Message("The part sticks.", "Das Teil klebt."),
                      evidence=Evidence(ratio, context.threshold))


RULE = AlarmRule(
    name=NAME, node_number=5099, type_number=1099, title=Message("Sticky part", "Klebendes Teil"),
    description=Message("The part sticks.", "Das Teil klebt."),
    input_node="Friction/StaticFriction", evaluate=evaluate,
    settings=RuleSettings(severity=450, on_delay=1, off_delay=2, activate_above=1.5, clear_below=1.2),
)
'''
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
snapshot = make_snapshot(make_capture(), mu_s=0.4)
wear = replace(snapshot.wear, level=0.2)
raised = []
for cycle in range(1, 6):
    inputs = alarms.CycleInputs(
        cycle, wear, friction=snapshot.friction, false_alarm_cycles=1e5, period_s=1.0
    )
    results = alarms.evaluate(settings, state, inputs)
    state, transitions = alarms.update(settings, state, results, cycle, cycle * 10**9)
    raised += [t.alarm for t in transitions]
(alarm,) = raised
assert (alarm.name, alarm.severity, alarm.cycle) == ("Sticky", 450, 2), alarm
assert (alarm.message, alarm.message_de) == ("The part sticks.", "Das Teil klebt."), alarm
assert abs(alarm.evidence.statistic - 2.0) < 1e-12 and alarm.evidence.false_alarm_cycles == 1e5
assert alarms.NAMES[-1] == "Sticky"
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


def test_a_rule_is_one_file(tmp_path: Path) -> None:
    tree = Path(impactcell.__file__).parents[1]
    for package in ("impactcell", "tests"):
        shutil.copytree(
            tree / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__", "node")
        )
    (tmp_path / "impactcell" / "alarms" / "rules" / "sticky.py").write_text(RULE, encoding="utf-8")
    shutil.copy2(tree / "pyproject.toml", tmp_path)
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    run = subprocess.run(
        [sys.executable, "-c", SEEN, str(tree / "config" / "cells" / "prototype.yaml")],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    others = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-n0",
            "-p",
            "no:cacheprovider",
            "tests/unit/alarms/test_alarm_set.py",
        ],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert others.returncode == 0, others.stdout


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
