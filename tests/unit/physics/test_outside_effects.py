"""An effect of the user's own is used like one of the library, and told what it owes."""

import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from impactcell.cli.app import run_verb
from impactcell.discrepancy.model import effect_coordinates
from impactcell.errors import EffectError, PhysicsError, SettingsError
from impactcell.physics import Plant, TapInput, outside_effects, simulate_free_slide
from impactcell.physics.effect_contract import contract_faults
from impactcell.physics.effects import LIBRARY, withdraw_effect
from impactcell.physics.ensemble import Ensemble
from impactcell.physics.outside_effects import (
    load_effect,
    offer_effects,
    offer_installed,
    offer_texts,
    offered_texts,
    source_of,
)
from impactcell.prediction.model import Model, Prior
from impactcell.settings.model_file import read_model, write_model

OWN = '''
"""A constant force along +1."""

from impactcell.physics.effect import Effect, Kind, LawKind, Parameter, Phase


def pull(_a, _b, _c, _d, p):
    """P."""
    return p[0]


EFFECT = Effect(
    identifier="own_pull",
    kind=Kind.BODY,
    equation="+P",
    reference="a weight on a string",
    phases=(Phase.FREE_SLIDE,),
    parameters=(Parameter("pull_n", "N", null=0.0, lower=-10.0, upper=10.0, typical=1.0),),
    laws={LawKind.BODY: pull},
)
'''


@pytest.fixture
def own(tmp_path: Path) -> Iterator[Path]:
    file = tmp_path / "own_pull.py"
    file.write_text(OWN, encoding="utf-8")
    yield file
    withdraw_effect("own_pull")


def test_a_file_is_all_it_takes(own: Path) -> None:
    assert offer_effects([own]) == ("own_pull",)
    plant = Plant(6.5e5, 465.0, 0.2, 0.152, effects={"own_pull": {"pull_n": 5.0}})
    moved = simulate_free_slide(plant, TapInput(1.0, 18.9), 0.1)
    assert moved.displacement_m == pytest.approx(0.1**2 / 2.0 / (0.152 * 9.81 - 5.0 / 18.9), rel=1e-9)
    assert offer_effects([own.parent]) == ()  # the same file once more


def test_a_model_says_where_its_effects_are(own: Path) -> None:
    offer_effects([own])
    plant = Plant(6.5e5, 465.0, 0.2, 0.152, effects={"own_pull": {"pull_n": 5.0}})
    path = own.parent / "model.yaml"
    write_model(Model("own", plant, Prior(1.0, 1.0, 0.1)), path)
    withdraw_effect("own_pull")
    assert read_model(path).plant.effects["own_pull"]["pull_n"] == 5.0
    path.write_text(path.read_text(encoding="utf-8").replace("own_pull.py", "gone.py"), encoding="utf-8")
    with pytest.raises(SettingsError, match=r"model\.yaml:\d+:\d+: .*gone\.py: there is no such file"):
        read_model(path)


def test_an_effect_that_was_withdrawn_leaves_nothing_behind(own: Path) -> None:
    offer_effects([own])
    plant, tap = Plant(6.5e5, 465.0, 0.2, 0.152, effects={"own_pull": {"pull_n": 5.0}}), TapInput(1.0, 18.9)
    helped = Ensemble([tap], ["own_pull"], initial_speed_m_s=np.array([0.1]))
    assert simulate_free_slide(plant, tap, 0.1).displacement_m == pytest.approx(
        0.1**2 / 2.0 / (0.152 * 9.81 - 5.0 / 18.9), rel=1e-9
    )
    (before,) = effect_coordinates("own_pull", 1)
    withdraw_effect("own_pull")
    assert offered_texts() == {}
    assert source_of("own_pull") is None
    with pytest.raises(PhysicsError, match="no effect is called 'own_pull'"):
        simulate_free_slide(plant, tap, 0.1)
    own.write_text(OWN.replace("return p[0]", "return -p[0]").replace("upper=10.0", "upper=20.0"), "utf-8")
    assert offer_effects([own]) == ("own_pull",)  # the same file, with another law
    assert simulate_free_slide(plant, tap, 0.1).displacement_m == pytest.approx(
        0.1**2 / 2.0 / (0.152 * 9.81 + 5.0 / 18.9), rel=1e-9
    )
    (after,) = effect_coordinates("own_pull", 1)
    assert (before.upper, after.upper) == (10.0, 20.0)
    # Who has the old one goes on with all of it.
    assert helped.parameters(plant)[-1] == 5.0
    with pytest.raises(PhysicsError, match="outside -10 to 10"):
        helped.parameters(replace(plant, effects={"own_pull": {"pull_n": 15.0}}))


def test_every_effect_of_the_library_keeps_the_contract() -> None:
    assert {name: faults for name, effect in LIBRARY.items() if (faults := contract_faults(effect))} == {}


def check(own: Path, *changes: tuple[str, str]) -> str:
    text = OWN
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    own.write_text(text, encoding="utf-8")
    with pytest.raises(EffectError) as caught:
        run_verb(["effect", "check", str(own)])
    assert str(caught.value).startswith(str(own))
    return str(caught.value)


def test_the_check_passes_what_is_right(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        run_verb(["effect", "check", str(own)])
    assert ended.value.code == 0
    assert "in order" in capsys.readouterr().out
    assert "own_pull" not in LIBRARY


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ([("return p[0]", "return p[0")], ":9: '[' was never closed"),
        ([("return p[0]", "return p[0]\n\n1 / 0")], ":11: ZeroDivisionError"),
        ([("EFFECT =", "MINE =")], "defines no EFFECT"),
        (
            [('identifier="own_pull"', 'identifier="other"')],
            "calls its effect 'other'; call it 'own_pull' too",
        ),
        ([('reference="a weight on a string"', 'reference=" "')], "it gives no reference"),
        ([('equation="+P"', 'equation=""')], "it gives no equation"),
        ([("phases=(Phase.FREE_SLIDE,)", "phases=()")], "names no phase"),
        ([("laws={LawKind.BODY: pull}", "laws={}")], "needs either laws or between="),
        ([('"pull_n"', '"pull"')], "pull is in N: its name has to end with _n"),
        ([("typical=1.0", "typical=100.0")], "typical 100 is not within its range"),
        ([("null=0.0", "null=float('nan')")], "no parameter has a null value"),
        ([('"""P."""\n', "")], "law pull has no docstring"),
        ([('"""A constant force along +1."""\n', "")], "its file has no docstring"),
        ([("return p[0]", "return p[0] + 1.0")], "does not vanish at its null values"),
        ([("return p[0]", "return 1e-6 * p[0]")], "more than 0.1 % shows"),
        ([("return p[0]", "return 20.0 * p[0] / max(10.0 - p[0], 1e-320)")], "not finite at"),
        ([("return p[0]", "return p[0] + 1e-7 * ((p[0] * 1e9) % 1.0)")], "let nothing switch inside a law"),
        ([("laws=", "dissipates=True, laws=")], "claims to dissipate, and gives energy"),
        ([("return p[0]", "return str(p)")], "cannot be compiled"),
    ],
)
def test_the_check_says_what_is_broken(own: Path, changes: list[tuple[str, str]], told: str) -> None:
    assert told in check(own, *changes)
    assert "own_pull" not in LIBRARY


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            [("EFFECT =", 'TABLE = {"a": 1.0}\n\n\nEFFECT ='), ("return p[0]", 'return p[0] * TABLE["a"]')],
            "its law pull (BODY) cannot be compiled",
        ),
        (
            [("null=0.0, lower=-10.0", 'null=float("inf"), lower=0.0'), ("typical=1.0", "typical=0.0")],
            "pull_n: it vanishes at infinity, so its typical 0 has to be above 0",
        ),
        (
            [
                ("Kind.BODY,", "Kind.BETWEEN_SHOTS,"),
                ("laws={LawKind.BODY: pull}", "between=lambda parameters, shots: shots.oil"),
            ],
            "its between= cannot be evaluated: AttributeError",
        ),
    ],
)
def test_a_run_begins_with_effects_that_can_be_used(
    own: Path, changes: list[tuple[str, str]], told: str
) -> None:
    """One that could not be compiled was offered, and ended the run with a traceback minutes later."""
    text = OWN
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    own.write_text(text, encoding="utf-8")
    with pytest.raises(EffectError, match=re.escape(f"own_pull.py: {told}")):
        run_verb(["discrepancy", "nowhere", "-o", str(own.parent / "out"), "--effects", str(own)])
    assert "own_pull" not in LIBRARY


def test_what_cannot_be_offered_is_told_and_nothing_offered(own: Path) -> None:
    before = set(LIBRARY)
    taken = own.parent / "viscous_friction.py"
    taken.write_text(OWN.replace("own_pull", "viscous_friction"), encoding="utf-8")
    with pytest.raises(PhysicsError, match="'viscous_friction' is there already"):
        offer_effects([own, taken])
    with pytest.raises(PhysicsError, match="no such file or folder"):
        offer_effects([own.parent / "gone"])
    (own.parent / "empty").mkdir()
    with pytest.raises(PhysicsError, match="has no file of an effect"):
        offer_effects([own.parent / "empty"])
    with pytest.raises(PhysicsError, match="is no identifier"):
        load_effect(own.parent / "my-effect.py")
    assert set(LIBRARY) == before


def test_another_process_is_given_the_text(own: Path) -> None:
    offer_effects([own])
    texts = offered_texts()
    assert texts == {"own_pull": OWN}
    offer_texts(texts)  # the same text once more
    with pytest.raises(PhysicsError, match="another own_pull"):
        offer_texts({"own_pull": OWN.replace("return p[0]", "return -p[0]")})
    withdraw_effect("own_pull")
    assert offered_texts() == {}
    offer_texts(texts)
    assert "own_pull" in LIBRARY
    assert offered_texts() == texts


def test_a_file_that_ends_the_program_is_a_fault(own: Path) -> None:
    """A script that calls `exit` ended the check with code 0, and without a word."""
    own.write_text(f"{OWN}\nraise SystemExit(0)\n", encoding="utf-8")
    with pytest.raises(PhysicsError, match=r"own_pull\.py:\d+: ends the program as it is read"):
        load_effect(own)
    assert "own_pull" not in LIBRARY


@pytest.mark.slow
def test_no_traceback_reaches_the_user(own: Path) -> None:
    own.write_text(OWN.replace("return p[0]", "return str(p)"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "impactcell", "effect", "check", str(own)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "cannot be compiled" in done.stderr
    assert "Traceback" not in done.stderr


def test_installed_plug_ins_are_offered(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    effect = load_effect(own)
    owner = SimpleNamespace(name="somebody")

    def point(name: str, content: object) -> SimpleNamespace:
        def load() -> object:
            if isinstance(content, Exception):
                raise content
            return content

        return SimpleNamespace(name=name, value="somebody.effects", dist=owner, load=load)

    points = [point("own_pull", effect)]
    monkeypatch.setattr(outside_effects, "entry_points", lambda group: points)
    assert offer_installed() == ("own_pull",)
    assert offer_installed() == ("own_pull",)
    points.append(point("broken", ImportError("no module named x")))
    with pytest.raises(
        PhysicsError, match=r"plug-in 'broken' of somebody: no module named x; .* pip uninstall somebody"
    ):
        offer_installed()
