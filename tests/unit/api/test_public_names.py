"""What `import impactcell` offers, to the name; and what it costs."""

import inspect
import subprocess
import sys
import typing

import pytest

import impactcell

PUBLIC = {
    "DiscrepancyFindings",
    "FrictionEstimate",
    "SimulatedTap",
    "Tap",
    "TapPlanner",
    "TrackedSeries",
    "Unreachable",
    "discrepancy",
    "estimate",
    "simulate_tap",
    "track",
}


def test_these_names_and_no_other() -> None:
    assert set(impactcell.__all__) == PUBLIC
    assert {name for name in dir(impactcell) if not name.startswith("_")} == PUBLIC
    with pytest.raises(AttributeError, match="no attribute 'strike'"):
        _ = impactcell.strike


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_each_is_documented_and_typed(name: str) -> None:
    thing = getattr(impactcell, name)
    assert inspect.getdoc(thing)
    if inspect.isfunction(thing):
        hints = typing.get_type_hints(thing)
        assert set(hints) == {*inspect.signature(thing).parameters, "return"}
        assert "Parameters" in inspect.getdoc(thing)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("simulate_tap", ["velocity_m_s", "mass_kg", "stroke_m", "plant", "time_s"]),
        ("estimate", ["time_s", "force_n", "position_m", "velocity_m_s", "mass_kg", "stroke_m", "model"]),
        ("track", ["cycle", "mu_s", "mu_s_std", "batch", "limit", "mu_s_common_std"]),
        ("discrepancy", ["campaign", "model", "seed", "base", "train", "test"]),
    ],
)
def test_parameters_keep_names_and_order(name: str, parameters: list[str]) -> None:
    assert list(inspect.signature(getattr(impactcell, name)).parameters) == parameters


def run(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_importing_it_loads_nothing_heavy() -> None:
    loaded = set(run("import sys, impactcell; print(*sys.modules)").split())
    assert not loaded & {"numpy", "scipy", "numba", "pydantic", "asyncio", "asyncua"}
    assert not any(name.startswith("impactcell.") for name in loaded)


@pytest.mark.slow
def test_the_function_and_the_room_of_one_name_do_not_shadow_each_other() -> None:
    # whichever is asked for first, each in a process of its own that has the libraries loaded
    code = """
import os, numpy, scipy.optimize, scipy.signal, numba
for first in ("pass", "import impactcell.discrepancy.workflow", "import impactcell; impactcell.discrepancy"):
    if os.fork() == 0:
        break
    assert os.wait()[1] == 0, first
else:
    os._exit(0)
import inspect
exec(first)
import impactcell
from impactcell.discrepancy import workflow
assert impactcell.discrepancy.workflow is workflow
from impactcell.api.findings import discrepancy
assert inspect.signature(impactcell.discrepancy) == inspect.signature(discrepancy)
try:
    impactcell.discrepancy("/nowhere")
except Exception as error:
    print(type(error).__name__)
"""
    assert run(code).split() == ["CampaignError"] * 3
