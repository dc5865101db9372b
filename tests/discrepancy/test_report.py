"""The report is whole, stands alone, and says the same as the findings."""

from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

import numpy as np
import pytest

from impactcell.discrepancy.model import ParameterEstimate, Problem
from impactcell.discrepancy.report import figures, sentences
from impactcell.discrepancy.report.page import (
    SENTENCES,
    format_number,
    page_context,
    report_environment,
    write_report,
)
from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.report.sentences import headline, phrase
from impactcell.discrepancy.search.conclusion import Place, Remaining
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.german.findings import REPORTS
from impactcell.physics.effect_names import as_title
from impactcell.physics.effects import LIBRARY
from tests.discrepancy.test_workflow import investigated

pytestmark = pytest.mark.slow

SECTIONS = ["Where they disagree", "Held-out shots", "Evidence for every candidate", "Parameters"]
VOID = {"meta", "br", "path", "use"}


class Page(HTMLParser):
    """Headings, links and text of a page whose tags have to match."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.headings: list[str] = []
        self.targets: list[str] = []
        self.text = ""
        self.pictures = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.pictures += tag == "svg"
        self.targets += [value or "" for name, value in attrs if name in {"src", "href", "xlink:href"}]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def outside(self) -> list[str]:
        """Whatever is not inside the page itself."""
        return [target for target in self.targets if not target.startswith(("#", "data:"))]

    def handle_data(self, data: str) -> None:
        self.text += data
        if self.open and self.open[-1] == "h2":
            self.headings.append(data)


def text_of(found: DiscrepancyResult, directory: Path) -> str:
    write_report(found, "a campaign", directory / "report.html")
    return (directory / "report.html").read_text(encoding="utf-8")


def read(text: str) -> Page:
    page = Page()
    page.feed(text)
    assert page.open == []
    return page


@pytest.fixture(scope="module")
def tied() -> DiscrepancyResult:
    return investigated("mass_error", shots=18)


@pytest.fixture(scope="module")
def text_of_tied(tied: DiscrepancyResult, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Its page, written once: the pictures are most of the time."""
    return text_of(tied, tmp_path_factory.mktemp("tied"))


@pytest.fixture(scope="module")
def context_of_tied(tied: DiscrepancyResult) -> dict[str, Any]:
    return page_context(tied, "a campaign")


@pytest.fixture(scope="module")
def unknown() -> DiscrepancyResult:
    return investigated("actuator_vibration", shots=18)


def test_the_page_is_whole_and_fetches_nothing(text_of_tied: str) -> None:
    page = read(text_of_tied)
    assert page.headings == [*SECTIONS, "How it was computed"]
    assert page.outside() == []
    assert page.pictures == 4  # two maps, the traces, the friction factors
    assert all(as_title(phrase(effect)) in page.text for effect in LIBRARY)
    assert "weigh the part" in page.text
    assert "the intervals hold whichever of the effects that these shots cannot tell apart" in page.text


def test_the_first_screen_says_what_it_means_and_what_to_do(
    tied: DiscrepancyResult, text_of_tied: str
) -> None:
    text = read(text_of_tied).text
    first_screen = text[: text.index("Where they disagree")]
    assert "A noise floor is the difference between model and measurement" in first_screen
    assert first_screen.index("A noise floor is") < first_screen.index("held-out gap in noise floors")
    for effect in ("mass_error", "force_sensor_gain"):
        assert LIBRARY[effect].meaning in first_screen
        assert f"Look at {LIBRARY[effect].look_at}." in first_screen
    for effect in result_document(tied)["effects"]:
        assert effect["meaning"] == LIBRARY[effect["effect"]].meaning
        assert effect["look_at"] in first_screen
    assert "impactcell model accept CELL.yaml model.extended.yaml" in first_screen
    assert "weigh the part" in first_screen


def test_batches_are_told_by_name_and_in_order(tied: DiscrepancyResult) -> None:
    shift = ParameterEstimate("batch_shift", "relative_change", 1, 0.05, 0.04, 0.06, at_bound=False)
    found = replace(tied, prepared=replace(tied.prepared, batches=("9", "7")), stated_parameters=(shift,))
    for language, batch in (("en", "batch"), ("de", "Charge")):
        (row,) = page_context(found, "a campaign", language)["parameters"]
        assert row["name"].endswith(f"[{batch} 7]")
    assert result_document(found)["batches"] == ["9", "7"]


def test_noise_alone_is_drawn_thin(tied: DiscrepancyResult, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four standard deviations of noise take a fifth of a panel, a per cent of friction a tenth, at most."""
    drawn: list[Any] = []
    monkeypatch.setattr(figures, "svg", lambda figure, _said: drawn.append(figure) or "")
    figures.trace_figure(tied, sentences)
    figures.factor_figure(tied, sentences)
    residuals = drawn[0].axes[1::2]
    assert len(residuals) == 9
    for axes, noise in (*((axes, 4.0) for axes in residuals), (drawn[1].axes[0], 2.0)):
        low, high = axes.get_ylim()
        assert high - low >= 5.0 * noise
        assert all(low <= value <= high for line in axes.lines for value in line.get_ydata())


@pytest.mark.parametrize(("held_out", "shown"), [(1, 1), (2, 2), (3, 3), (4, 3)])
def test_each_held_out_shot_is_drawn_once(
    tied: DiscrepancyResult, monkeypatch: pytest.MonkeyPatch, held_out: int, shown: int
) -> None:
    drawn: list[Any] = []
    problem = tied.held_problem
    assert len(problem.shots.items) >= held_out
    samples = slice(0, int(problem.shots.bounds[held_out]))
    few = replace(
        tied,
        held_problem=Problem(problem.shots.select(np.arange(held_out)), problem.batches, problem.effects),
        held_nominal=replace(tied.held_nominal, residual=tied.held_nominal.residual[samples]),
        held_final=replace(tied.held_final, residual=tied.held_final.residual[samples]),
    )
    monkeypatch.setattr(figures, "svg", lambda figure, _said: drawn.append(figure) or "")
    figures.trace_figure(few, sentences)
    titles = [axes.get_title() for axes in drawn[0].axes if axes.get_title()]
    assert len(titles) == len(set(titles)) == shown


@pytest.mark.parametrize(
    ("held_out", "english", "german"),
    [
        (1, "The only one that was held out.", "Der einzige zurückgehaltene."),
        (2, "Both, the one that the nominal model", "Beide, der vom Ausgangsmodell besser"),
        (3, "The best, the median and the worst", "Der vom Ausgangsmodell am besten, der im Median"),
    ],
)
def test_what_is_drawn_of_held_out_shots_is_said(
    tied: DiscrepancyResult, held_out: int, english: str, german: str
) -> None:
    for language, said in (("en", english), ("de", german)):
        template = report_environment(SENTENCES[language]).get_template(f"{REPORTS[language]}.j2")
        assert said in template.render(page_context(tied, "a campaign", language) | {"held_out": held_out})


def test_a_tie_is_told_in_the_sentence(tied: DiscrepancyResult) -> None:
    first, second = (phrase(one) for one in (tied.added[0], *tied.selection.ties[tied.added[0]]))
    assert {first, second} == {"mass error", "force sensor gain"}
    sentence = headline(tied)
    assert sentence.startswith(f"Missing: {first} or {second}, which these shots cannot tell apart; the held")


def test_an_unknown_gap_leads_to_the_guide(unknown: DiscrepancyResult, tmp_path: Path) -> None:
    page = read(text_of(unknown, tmp_path))
    (link,) = page.outside()
    guide = urlparse(link)
    assert guide.scheme == "file"
    assert "## A new effect" in Path(unquote(guide.path)).read_text(encoding="utf-8")
    assert unknown.unexplained is not None
    assert f"largest in phase {phrase(unknown.unexplained.phase)}" in page.text
    assert "→" not in page.text
    assert "the intervals hold whichever" not in page.text
    assert headline(unknown).startswith("No known effect explains a held-out gap of")


def test_what_remains_beside_an_established_effect_is_a_sentence_of_its_own(
    tied: DiscrepancyResult, tmp_path: Path
) -> None:
    left = Remaining(explained=False, share=0.4, where=(Place("free_slide", ("velocity",)),), level=1.7)
    both = replace(tied, conclusion=replace(tied.conclusion, remaining=left))
    sentence = headline(both)
    assert sentence.startswith(headline(tied))
    assert f"falls from {tied.validation.gap_before:.2f} to {tied.validation.gap_after:.2f}" in sentence
    assert sentence.endswith("It leaves 40 % of the gap, in free slide.")
    assert "in free slide with velocity" in read(text_of(both, tmp_path)).text


def test_an_interval_that_ends_at_a_bound_is_shown_as_one(
    tied: DiscrepancyResult, text_of_tied: str, tmp_path: Path
) -> None:
    assert "bound of its range" not in read(text_of_tied).text
    ended = replace(tied.stated_parameters[0], at_bound=True)
    stated = (ended, *tied.stated_parameters[1:])
    page = read(text_of(replace(tied, stated_parameters=stated), tmp_path))
    assert page.text.count("bound of its range") == 1


def test_parameters_have_their_units_and_regions_their_place(
    tied: DiscrepancyResult, context_of_tied: dict[str, Any]
) -> None:
    shown = context_of_tied
    units = {row["name"]: row["unit"] for row in shown["parameters"]}
    assert units["stiffness"] == "N/m"
    assert units["damping"] == "N s/m"
    assert units["µk"] == units["relative error"] == ""
    channels = shown["regions"]["channels"]
    cells = {
        (phase, channel, *cell)
        for phase, row in shown["regions"]["rows"]
        for channel, cell in zip(channels, row, strict=True)
        if cell is not None
    }
    assert cells == set(tied.validation.regions)


def test_numbers_are_told_as_one_reads_them(context_of_tied: dict[str, Any]) -> None:
    assert [format_number(value) for value in (670681.4, 440.834, 0.155968, 249.9, 3.2e-6, 4e9)] == [
        "670 680",
        "440.83",
        "0.15597",
        "249.9",
        "3.2e-06",
        "4e+09",
    ]
    shown = {row["name"]: row for row in context_of_tied["parameters"]}
    assert shown["µs/µk"]["value"] > 1.0


def test_a_phone_scrolls_tables_and_not_the_page(text_of_tied: str) -> None:
    page = text_of_tied
    assert page.count("<table>") == page.count('<div class="wide" tabindex="0"><table>') > 3
