"""Why a positioning task ends or is refused is said in German, in its alarm and on the page."""

import ast
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import impactcell
from impactcell.alarms.rules import positioning_fault
from impactcell.german.positioning_reasons import german_positioning_reason
from impactcell.web.cell_view import CellView
from impactcell.web.interface import CellNews
from tests.snapshots import make_capture, make_snapshot

PACKAGE = Path(impactcell.__file__).parent
SAID_BY = (
    "positioning/task_state_machine.py",
    "positioning/safety_limits.py",
    "positioning/planner.py",
    "positioning/planner_questions.py",
    "positioning/without_tap.py",
    "service/positioning.py",
    "fieldbus/tap_commands.py",
)
"""Where a task can say why it ends, or is refused."""
SAID_AS = ("PositioningError", "ObjectionError", "Unreachable")
NO_TASK = re.compile(
    r"tap planner: .*|remaining distance must .*|(mass|position) of the part must .*|"
    r"cannot (learn from|use) .*"
)
"""What the planner says to who calls it otherwise than a task does."""
CELLS = {"cell", "name", "cell.name", "self._cell.name", "self._module.cell"}
STANDS_FOR = {
    "error": ["not connected"],
    "answer.reason": ["tap 7 moved nothing"],
    "by": ["anna"],
    "why": ["the part no longer lies where the tap was planned from"],
    "_struck(sent)": ["nothing has been commanded", "the part may have been struck"],
    "_struck(bool(sequence))": ["nothing has been commanded", "the part may have been struck"],
    "miss": ["tap 7 moved nothing"],
    "positioning.result": ["7"],
}
"""For what is put into a text; all else is a number."""
ENGLISH = re.compile(
    r"\b(the|tap|taps|not|is|of|part|by|module|with|and|for|no|it|to|has|been|target|stroke|moved)\b"
)


def strings(node: ast.expr | None, named: dict[str, ast.expr]) -> list[str]:
    """Every text that an expression may be, with something in place of what is put in."""
    match node:
        case ast.Constant(value=str(text)):
            return [text]
        case ast.IfExp():
            return strings(node.body, named) + strings(node.orelse, named)
        case ast.Name(id=name) if name in named:
            return strings(named[name], {})
        case ast.JoinedStr(values=values):
            texts = [""]
            for value in values:
                if isinstance(value, ast.FormattedValue):
                    put_in = ast.unparse(value.value)
                    known = ["press-1"] if put_in in CELLS else STANDS_FOR.get(put_in)
                    ends = strings(value.value, named) or known or ["7"]
                else:
                    ends = strings(value, named)
                texts = [text + end for text in texts for end in ends]
            return texts
    return []


def said(source: Path) -> Iterator[str]:
    tree = ast.parse(source.read_text(encoding="utf-8"))
    nodes = list(ast.walk(tree))
    assigned = [(a.targets[0], a.value) for a in nodes if isinstance(a, ast.Assign)]
    named = {target.id: value for target, value in assigned if isinstance(target, ast.Name)}
    for node in nodes:
        match node:
            case ast.Call(
                func=ast.Name(id="PositioningError" | "ObjectionError" | "Unreachable"), args=[text, *_]
            ):
                yield from strings(text, named)
            case ast.Call(func=ast.Name(id="failed") | ast.Attribute(attr="failed"), args=[_, text, *_]):
                yield from strings(text, named)
            case ast.keyword(arg="reason", value=text):
                yield from strings(text, named)
            case ast.Assign(targets=[ast.Name(id="fault")], value=text):
                yield from strings(text, named)
            case ast.FunctionDef(name="_miss", body=body):
                for inner in body:
                    for returned in ast.walk(inner):
                        if isinstance(returned, ast.Return):
                            yield from strings(returned.value, named)
            case ast.Assign(targets=[ast.Name(id="BY_PLC")], value=ast.Constant(value=str(plc))):
                yield f"aborted by {plc}"


REASONS = sorted(
    {text for path in SAID_BY for text in said(PACKAGE / path) if text and not NO_TASK.fullmatch(text)}
)


def test_the_reasons_are_found() -> None:
    assert len(REASONS) > 45
    for words in (
        "moved nothing", "not in place after", "lies behind", "N is not allowed", "may pass the end",
        "taps in a row", "may have been struck", "press-1: not connected", "set the target again", "PLC",
        "in place; tap", "does not show what", "times before tap",
    ):  # fmt: skip
        assert any(words in reason for reason in REASONS), words


@pytest.mark.parametrize("reason", REASONS)
def test_every_reason_has_its_german(reason: str) -> None:
    german = german_positioning_reason(reason)
    assert german != reason, "say it in impactcell/german/positioning_reasons.py"
    assert not ENGLISH.search(german), german
    assert german.startswith("press-1: ") is reason.startswith("press-1: ")


@pytest.mark.parametrize(
    ("reason", "german"),
    [
        ("press-1: tap 3 moved nothing", "press-1: Stoß 3 hat nichts bewegt"),
        (
            "press-1: a tap that may bring the part to 40.072 mm is not allowed, its travel is 0 to 40 mm",
            (
                "press-1: ein Stoß, der das Teil bis 40,072 mm bringen kann, ist nicht erlaubt, der "
                "Verfahrweg ist 0 bis 40 mm"
            ),
        ),
        ("aborted by the PLC, which has a new target", "abgebrochen von der SPS, die ein neues Ziel hat"),
        ("aborted by anna", "abgebrochen von anna"),
        ("press-1: tap 4: refused value", "press-1: Stoß 4: refused value"),
        (
            "press-1: 10.0.0.9:502 device 1: no connection within 0.5 s; nothing has been commanded",
            "press-1: 10.0.0.9:502 Gerät 1: keine Verbindung innerhalb von 0,5 s; es wurde nichts befohlen",
        ),
        (
            "press-1: m:502 device 1: no connection within 1 s; the part may have been struck",
            "press-1: m:502 Gerät 1: keine Verbindung innerhalb von 1 s; das Teil kann gestoßen worden sein",
        ),
        ("in place; tap 3 moved nothing", "am Ziel; Stoß 3 hat nichts bewegt"),
        (
            (
                "the part cannot lie 4.5 m from its target; distances are in metres: if that was meant "
                "in mm, give 0.0045"
            ),
            (
                "das Teil kann nicht 4,5 m von seinem Ziel liegen; Abstände werden in Metern angegeben: "
                "waren mm gemeint, 0,0045 angeben"
            ),
        ),
        (
            "the part cannot lie 1e+06 m from its target; distances are in metres",
            "das Teil kann nicht 1e+06 m von seinem Ziel liegen; Abstände werden in Metern angegeben",
        ),
        ("what nobody has translated", "what nobody has translated"),
        ("", ""),
    ],
)
def test_a_sentence(reason: str, german: str) -> None:
    assert german_positioning_reason(reason) == german


def test_the_alarm_and_the_page_say_it() -> None:
    reason = "press-1: the mass of the part is not known; state it in the cell file or register"
    message = positioning_fault.result(reason).message
    assert message is not None
    assert reason in message.english
    assert "press-1: die Masse des Teils ist nicht bekannt; sie in der Zellendatei" in message.german
    snapshot = make_snapshot(make_capture())
    view = CellView("press-1")
    view.take(
        CellNews(
            "press-1", snapshot=replace(snapshot, positioning=replace(snapshot.positioning, reason=reason))
        )
    )
    reasons = json.loads(view.encode("card"))["reasons"]
    assert reasons["en"]["positioning"] == reason
    assert reasons["de"]["positioning"] == german_positioning_reason(reason)
