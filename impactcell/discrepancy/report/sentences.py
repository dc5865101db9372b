"""The outcome in two sentences: what is established, and what remains."""

import math
from collections.abc import Sequence
from typing import Any

from impactcell.discrepancy.data import CHANNELS
from impactcell.discrepancy.report.next_step import Step, lacks_replicates, plan_next_step
from impactcell.discrepancy.report.planned_experiments import by_effect
from impactcell.discrepancy.search import NO_GAP, UNTESTED, Remaining, Validation
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.german.findings import enumerated
from impactcell.german.open_loop import open_loop_sentence
from impactcell.physics import Kind
from impactcell.physics.effect_names import as_title, in_words
from impactcell.physics.effects import LIBRARY, OF_PRODUCT, find_effect
from impactcell.physics.free_column_forms import printed
from impactcell.physics.free_form import FreeForm


def phrase(identifier: str) -> str:
    """Name of an effect as one would say it."""
    return in_words(identifier)


def written(text: str) -> str:
    """Write the numbers of a text as the language does."""
    return text


def equation(english: str) -> str:
    """Say the equation of a law."""
    return english


def note(english: str) -> tuple[str, str]:
    """Say a note on the data: in which language, and the note."""
    return "en", english


def reference(english: str) -> str:
    """Say where the law of an effect comes from."""
    return english


def reason(english: str) -> tuple[str, str]:
    """Say why nothing is proposed: in which language, and the reason."""
    return "en", english


def headline(result: DiscrepancyResult) -> str:
    """Say what is established, what remains, which law explains it, and whether it can predict."""
    simulation, unit = result.simulation, result.prepared.excitation.unit
    follows = open_loop_sentence(simulation.channel, simulation.after.fit_percent, unit)
    return f"{_conclusion(result)}{_proposed(result)} {follows}".rstrip()


def _proposed(result: DiscrepancyResult) -> str:
    """Say which law would explain what is left; empty where none was found."""
    finding = result.law
    if finding is None or finding.refused:
        return ""
    change = finding.change
    before, after = change.before.of(change.parts), change.after.of(change.parts)
    falling = "friction factors' spread falls" if finding.term.form.is_between_shots else "traces fall"
    fall = f"{falling} from {before:.2f} to {after:.2f} noise floors"
    form = finding.term.form
    letters = "u and w" if form.second else "u"
    u = " and ".join(printed(name).replace("_", " ") for name in form.covariates)
    how = f"as a free-form function of {letters}, the {u}"
    if finding.proposed is not None:
        function = finding.proposed.functional_form
        how = f"as {function} of {letters}, the {u}"
        if not form.second:
            how = {"u": f"in proportion to the {u}", "1": "constant"}.get(function, how)
        listed = finding.proposed.listed
        how += f", {phrase(listed)}, which is not named" if listed else f", a law {_beside_what(form)}"
    return f" With s in {form.effect.equation} {how}, the {fall}."


def _beside_what(form: FreeForm) -> str:
    """Say which laws a proposed one is not among: one that was given for its place may be the same."""
    for name in set(LIBRARY) - OF_PRODUCT:
        effect = LIBRARY[name]
        if effect.between is not None if form.is_between_shots else form.law_kind in effect.laws:
            return "beside those that were given"
    return "that no library has"


def noise_floor_sentence(result: DiscrepancyResult) -> str:
    """Say what a noise floor is, in the numbers of this campaign."""
    units = zip(CHANNELS, result.floor.noise_std, (1.0, 1e6, 1e6), ("N", "µm", "µm"), strict=True)
    noise = [
        f"{channel} {scale * std:.3g} {unit}" for channel, std, scale, unit in units if not math.isnan(std)
    ]
    return (
        "A noise floor is the difference between model and measurement that the sensors' noise alone makes "
        f"(standard deviation of {', '.join(noise)}). A gap of 1 is a model that misses nothing; a gap of "
        f"{_gap(result.validation)} is that many times as far away."
    )


def advice(result: DiscrepancyResult) -> list[dict[str, Any]]:
    """Say of each missing effect, and of what is tied with it, what it means and what to look at."""
    rows = []
    for effect in result.added:
        for place, name in enumerate((effect, *result.selection.ties.get(effect, ()))):
            told = find_effect(name)
            if told.meaning:
                rows.append(
                    {
                        "name": phrase(name),
                        "is_rival": place > 0,
                        "meaning": told.meaning,
                        "look_at": told.look_at,
                    }
                )
    return rows


def next_step(result: DiscrepancyResult) -> str:
    """Say what to measure where no two effects have to be told apart."""
    step = plan_next_step(result)
    left = "between the shots" if step.phase == "between_shots" else f"in {phrase(step.phase)}"
    varied = " and ".join(phrase(name) for name in step.covariates)
    told = {
        Step.MORE_SHOTS: f"about {step.shots} {result.prepared.excitation.unit} more, at settings like these",
        Step.MASS: "the mass of the part, which no slide shows: without it no cell can run with this model",
        Step.REPLICATES: (
            "the same settings again: how far friction scatters between shots alike is not known"
        ),
        Step.OTHER_DIRECTION: (
            "nothing more for taps in this direction; where the part is tapped from the other end as well, "
            f"about {step.shots} taps from there: a tilt or an asymmetry passes for friction until then"
        ),
        Step.NOTHING: "nothing more; the gap on the cell's page shows whether it stays so",
        Step.PLACE: "the same settings again: held-out shots do not say yet where something remains",
        Step.MORE_OF_DIRECTION: (
            f"about {step.shots} more taps in direction {step.direction:+d}, of which there are few, "
            f"added to these; what remains is {left} and goes with the direction"
        ),
        Step.BATCHES: (
            "nothing new yet: give the shots of each mass a batch of its own in shots.csv, and run this "
            "again; what remains is between the shots and goes with the mass, and each batch has its friction"
        ),
        Step.VALUES: f"more values of {varied}, all else unchanged; what remains is {left}",
        Step.SAME: f"the same settings again; what remains is {left}",
    }
    return told[step.step]


def split_sentence(result: DiscrepancyResult) -> str:
    """How far contact and slide of taps stay from the floor when each is fitted alone; empty if unknown."""
    alone = result.unexplained.split_fits if result.unexplained else None
    if alone is None or math.isnan(alone.contact + alone.slide):
        return ""
    return (
        f" Fitted apart from each other, the contacts stay at {alone.contact:.2f} noise floors, "
        f"the slides after them at {alone.slide:.2f}."
    )


def label(english: str) -> str:
    """Say a label of a figure or a table."""
    return english


def told_apart(pairs: Sequence[tuple[str, str]]) -> str:
    """Say which effects an experiment tells from which.

    >>> told_apart([("surface_tilt", "batch_shift"), ("surface_tilt", "friction_drift")])
    'surface tilt from batch shift and from friction drift'
    """
    said = [(phrase(name), [f"from {phrase(one)}" for one in rivals]) for name, rivals in by_effect(pairs)]
    return ", and ".join(f"{name} {enumerated(rivals, 'and')}" for name, rivals in said)


def setting(english: str) -> str:
    """Say a setting of the next experiment."""
    return english


def shape(english: str) -> str:
    """Say what is left along a phase."""
    return english


def law_sentences(result: DiscrepancyResult) -> dict[str, Any] | None:
    """Say what the page tells of a law that nobody had listed; None where none was looked for."""
    finding = result.law
    if finding is None:
        return None
    form, law = finding.term.form, finding.proposed
    units = {} if law is None else {item.name: item.unit for item in law.parameters}
    tested = [
        f"{printed(name).replace('_', ' ')} from {low:.3g} to {high:.3g}{'' if unit == '1' else f' {unit}'}"
        for name, unit, (low, high) in finding.term.tested
    ]
    return {
        "refused": reason(finding.refused) if finding.refused else None,
        "equation": form.effect.equation if law is None else law.equation,
        "listed": phrase(law.listed) if law and law.listed else None,
        "spline_only": law is None,
        "subject": "spread of the friction factors" if form.is_between_shots else "traces",
        "before": finding.change.before.of(finding.change.parts),
        "after": finding.change.after.of(finding.change.parts),
        "p": finding.change.p_value,
        "equivalents": [item.law.functional_form for item in finding.equivalents],
        "rivals": [find_effect(place).equation for place in finding.rival_places],
        "tested": " and ".join(tested),
        "file": None if law is None else f"{law.identifier}.py",
        "parameters": [(one.parameter, one, units[one.parameter]) for one in finding.estimates],
    }


def _outdone(result: DiscrepancyResult) -> str:
    """Say which name comes nearest, and why it is not the answer; empty where none does."""
    outdone = result.selection.outdone
    if outdone is None or not outdone.form:
        return ""
    name = as_title(phrase(outdone.effect))
    form = f"a free function s, {find_effect(outdone.form).equation},"
    if outdone.same_place:
        return f" {name} comes nearest, but {form} follows better in the same place: the law is another."
    more = "more" if find_effect(outdone.effect).kind is Kind.BETWEEN_SHOTS else "as much"
    return f" {name} comes nearest, but {form} explains {more}: it is not the cause."


def _conclusion(result: DiscrepancyResult) -> str:
    proof, conclusion = result.validation, result.conclusion
    if conclusion.verdict == UNTESTED:
        unit = result.prepared.excitation.unit
        counts = f"{len(result.training)} to fit and {len(result.held_out)} held out"
        return (
            f"Too few {unit} to say: {counts}, about "
            f"{conclusion.missing_shots} more are needed. The held-out gap of the nominal model is "
            f"{_gap(proof)} noise floors."
        )
    if conclusion.verdict == NO_GAP:
        return f"The nominal model explains these shots: the held-out gap is {_gap(proof)} noise floors."
    if not conclusion.established:
        said = f"No known effect explains a held-out gap of {_gap(proof)} noise floors"
        if result.validation.is_at_floor:
            said = (
                "No known effect explains what the training shots show and held-out ones do not: their gap "
                f"is {_gap(proof)} noise floors"
            )
        if conclusion.unconfirmed:
            names = enumerated([*map(phrase, conclusion.unconfirmed)], "and")
            why = "held-out shots do not confirm it"
            if lacks_replicates(result):
                why = "without repeated settings held-out shots cannot confirm it"
            said = (
                f"{as_title(names)} would explain the training shots, but {why}: their gap is {_gap(proof)} "
                "noise floors"
            )
        return f"{said}{_where(result)}.{_outdone(result)}"
    groups = [
        " or ".join(map(phrase, (effect, *conclusion.ties.get(effect, ()))))
        for effect in conclusion.established
    ]
    is_tied = any(conclusion.ties.values())
    missing = f"{', and '.join(groups)}, which these shots cannot tell apart"
    beside = ""
    if not is_tied:
        missing, beside = enumerated(groups, "and"), "with them " if len(groups) > 1 else "with it "
    established = f"Missing: {missing}; {beside}{_fall(proof)}."
    return established if conclusion.remaining.explained else f"{established} {_left(conclusion.remaining)}"


def _fall(proof: Validation) -> str:
    """Say what falls: the gap, or only the spread between shots beside traces that stay as they are."""
    change = proof.held_out
    if change.low > 0.0 or not change.after.factor < change.before.factor:
        return f"the held-out gap falls from {proof.gap_before:.2f} to {proof.gap_after:.2f} noise floors"
    return (
        f"the held-out spread of the friction factors falls from {change.before.factor:.2f} to "
        f"{change.after.factor:.2f} times that of replicates, the traces stay at {change.after.trace:.2f} "
        "noise floors"
    )


def _gap(proof: Validation) -> str:
    return f"{proof.gap_before:.2f}"


def _where(result: DiscrepancyResult) -> str:
    if result.unexplained is not None:
        return f", largest in phase {phrase(result.unexplained.phase)}"
    return ""


def _left(remaining: Remaining) -> str:
    places = " and ".join(phrase(place.phase) for place in remaining.where)
    where = f", in {places}" if places else ""
    if math.isclose(remaining.share, 0.0):
        return f"Something remains that it does not explain{where}."
    return f"It leaves {100.0 * remaining.share:.0f} % of the gap{where}."
