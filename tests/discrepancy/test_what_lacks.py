"""What a term lacks that records want and that joins no model: headlines do not contradict its p."""

import math
from dataclasses import replace

import pytest

from impactcell.discrepancy.machine import FallOfGap
from impactcell.discrepancy.report import german_machine_sentences, german_sentences, machine_sentences
from tests.discrepancy.test_turning_on import drifting

WANTED = "held-out records want it (p = 0.0005)"
CONFIRMED = FallOfGap(2.0, 1.2, 0.8, 0.6, 0.9, 0.0005)


@pytest.mark.parametrize(
    ("fall", "lacks"),
    [
        (replace(CONFIRMED, p_value=0.3), "held-out records do not confirm it (p = 0.3)"),
        (
            replace(CONFIRMED, closed=0.01, low=0.002),
            f"{WANTED}, but it closes 1 % of their gap, less than counts",
        ),
        (
            replace(CONFIRMED, closed=0.2, low=-0.1, high=0.5),
            f"{WANTED}, but not alike: of their gap it closes -10 to 50 % (95 %), which may be nothing",
        ),
        (
            replace(CONFIRMED, before=1.01, closed=math.nan, low=math.nan, high=math.nan),
            f"{WANTED}, but without it they leave no gap that it could close",
        ),
    ],
)
def test_what_a_term_lacks_is_said_in_both_languages(fall: FallOfGap, lacks: str) -> None:
    assert not fall.is_real
    assert fall.lacks == lacks
    language, said = german_sentences.reason(lacks)
    assert language == "de"
    assert ("wollen es" in said) is ("want it" in lacks)


def test_what_is_confirmed_lacks_nothing() -> None:
    assert CONFIRMED.is_real
    assert CONFIRMED.lacks == ""


@pytest.mark.slow
def test_a_headline_says_what_is_lacking_and_not_that_held_out_records_deny_it() -> None:
    fall = replace(CONFIRMED, closed=0.01, low=0.002)
    finding = replace(
        drifting(), unconfirmed=("stribeck_friction",), unconfirmed_since={"stribeck_friction": fall.lacks}
    )
    said = machine_sentences.headline(finding)
    assert said.startswith("Stribeck friction would explain what fitted, but held-out records want it (p = ")
    assert "do not confirm" not in said
    assert machine_sentences.why_not_named(finding, "stribeck_friction") == fall.lacks
    german = german_machine_sentences.headline(finding)
    assert "zurückgehaltene Messungen wollen es (p = 0,0005), doch schließt es nur 1 % ihrer" in german
