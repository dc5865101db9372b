"""What a model of `discrepancy` says of itself: which of its numbers nothing tells, and what remains."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from impactcell.api.extended_model import write_extended_model
from impactcell.campaign import Excitation
from impactcell.discrepancy.model.intervals import ParameterEstimate
from impactcell.discrepancy.search import Place, Remaining
from impactcell.prediction import REMAINS
from impactcell.settings.model_file import read_model

NOTHING = Remaining(explained=True, share=0.0, where=(), level=0.0)
UNTOLD = "not told, so of no use in a cell"
KNOWN = {
    "stiffness_n_per_m": (398_662.0, 390_000.0, 407_000.0),
    "damping_n_s_per_m": (298.3, 290.0, 306.0),
    "mu_k": (0.17, 0.169, 0.171),
    "ratio": (1.25, 1.0, 1.4),
}


def provenance_of(
    folder: Path,
    intervals: dict[str, tuple[float, float, float]],
    added: tuple[str, ...] = (),
    remaining: Remaining = NOTHING,
) -> Any:
    """Provenance of the model file of such a result, of a record that nothing is calibrated to."""
    result: Any = SimpleNamespace(
        has_whole_plant=True,
        unseen=(),
        seed=0,
        verdict="unknown",
        added=added,
        validation=SimpleNamespace(gap_before=3.588, gap_after=1.5),
        conclusion=SimpleNamespace(remaining=remaining),
        prepared=SimpleNamespace(gravity_m_s2=9.81),
        parameters=[
            ParameterEstimate("", name, 0, *ends, ends[0] == ends[1]) for name, ends in intervals.items()
        ],
    )
    data: Any = SimpleNamespace(excitation=Excitation.DRIVEN, stroke_m=1.2e-3)
    write_extended_model(result, data, "c3", None, folder / "model.yaml")
    return read_model(folder / "model.yaml").provenance


def test_a_number_that_nothing_tells_is_said_to_be_of_no_use(tmp_path: Path) -> None:
    assert UNTOLD not in provenance_of(tmp_path, KNOWN)
    wide = {
        **KNOWN,
        "stiffness_n_per_m": (398_662.0, 100.0, 1e11),
        "damping_n_s_per_m": (298.3, 0.0, 399_480.0),
    }
    assert provenance_of(tmp_path, wide)[UNTOLD] == (
        "k 398662 ± 5e+10 N/m, b 298.3 ± 2e+05 N s/m (± is 95 %)"
    )


def test_a_number_that_came_to_its_bound_for_what_is_missing_is_not_known_exactly(tmp_path: Path) -> None:
    """It stood in the file with a deviation of 0.0001, and every tap was estimated with mu_s = mu_k."""
    at_bound = {**KNOWN, "ratio": (1.0, 1.0, 1.0)}
    assert UNTOLD not in provenance_of(tmp_path, at_bound)
    remaining = Remaining(False, 1.0, (), 4.4)
    assert UNTOLD not in provenance_of(tmp_path, KNOWN, (), remaining)
    assert provenance_of(tmp_path, at_bound, (), remaining)[UNTOLD] == "mu_k/mu_s 1.0000 ± 2 (± is 95 %)"


@pytest.mark.parametrize(
    ("remaining", "added", "said"),
    [
        (NOTHING, ("surface_tilt",), None),
        (
            Remaining(False, 0.12, (Place("free_slide", ()), Place("free_slide", ("mass",))), 1.0),
            ("surface_tilt",),
            "12% of the held-out gap, in free slide",
        ),
        (Remaining(False, 0.0, (), 1.0), ("surface_tilt",), "a pattern"),
        (Remaining(False, 1.0, (), 1.0), (), None),
    ],
)
def test_what_remains_beside_the_effects_is_in_the_file(
    tmp_path: Path, remaining: Remaining, added: tuple[str, ...], said: str | None
) -> None:
    assert provenance_of(tmp_path, KNOWN, added, remaining).get(REMAINS) == said
