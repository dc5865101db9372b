"""The figure of hidden effects: what is drawn is what was stored, for each version alike."""

import matplotlib as mpl
from matplotlib.figure import Figure

from impactcell.figures._style import STYLE
from impactcell.figures.hidden_effects import VERSIONS, by_effect, stored_counts
from tests.benchmarks._hidden_conditions import hidden_effects, other_conditions


def test_the_versions_were_given_the_same_conditions_of_the_study() -> None:
    known = {condition.key for condition in [*hidden_effects(), *other_conditions()]}
    before, now = (
        {count.condition for count in stored_counts() if count.version == version}
        for version, _, _ in VERSIONS
    )
    assert before == now <= known
    assert len(now) > len(hidden_effects()) // 2


def test_what_is_drawn_are_the_stored_counts() -> None:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 8.6))
        by_effect(figure)
        figure.draw_without_rendering()
        overshoot, taps = figure.axes
        for line, (version, _, _) in zip(taps.lines, VERSIONS, strict=True):
            part = [count for count in stored_counts() if count.version == version]
            assert list(line.get_xdata()) == [count.taps / count.tasks for count in part]
        assert len(overshoot.get_yticks()) == len({count.condition for count in stored_counts()})
        assert figure.legends[0].get_window_extent().y0 >= overshoot.get_window_extent().y1
