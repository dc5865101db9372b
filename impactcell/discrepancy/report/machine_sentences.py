"""What the report of a machine says beside its template."""

from impactcell.campaign import COLUMNS
from impactcell.discrepancy.machine import MachineFinding, MachineLaw, law_place, term_of
from impactcell.discrepancy.report.machine_parameters import law_covariates
from impactcell.discrepancy.report.sentences import equation, label, note, reason, setting, written
from impactcell.german.findings import enumerated
from impactcell.german.open_loop import better_sentence, open_loop_sentence
from impactcell.physics.effect_names import as_title, in_words

__all__ = ["equation", "headline", "label", "note", "phrase", "reason", "reference", "setting", "written"]


NOT_CONFIRMED = "held-out records do not confirm it"
"""What is said of a term of which it is not known what it lacks."""


def phrase(name: str) -> str:
    """Name of a term as one would say it."""
    identifier, _, column = name.partition("(")
    return in_words(identifier) + (f" by {column.rstrip(')')}" if column else "")


def reference(english: str) -> str:
    """Say where a law comes from."""
    return english


def headline(finding: MachineFinding) -> str:
    """Say what is established, what remains, and which law would explain it, if one was found."""
    law, said = finding.law, _conclusion(finding)
    if law is not None:
        if law.beside:
            take = "takes" if len(law.beside) == 1 else "take"
            said += f" Beside {enumerated(law.beside, 'and')}, which {take} it to {law.fall.before:.2f},"
        says = law_equation(finding, law)
        if law.listed:
            beside = " beside it" if finding.established else ""
            said += (
                f" {says}, {phrase(law.listed)}, would take the held-out gap{beside} to "
                f"{law.fall.after:.2f}; it is not named, since {why_not_named(finding, law.listed)}."
            )
        else:
            kind = "a smooth force, known as a table" if law.slices else "a law that nobody had listed"
            said += f" {says}, takes the held-out gap to {law.fall.after:.2f}: {kind}."
    errors, better = finding.simulated, finding.better_simulated
    if better is not None:
        rmse, names = (errors[-1].rmse, better.rmse), enumerated([*map(phrase, better.names)], "or")
        said += f" {better_sentence(names, rmse, finding.base.unit)}"
    fit = errors[-1].fit_percent
    return f"{said} {open_loop_sentence(finding.base.response, fit, 'records')}".rstrip()


def law_equation(finding: MachineFinding, law: MachineLaw) -> str:
    """Equation of a law, with what its powers are over; of its place where only a spline does as well."""
    if law.slices:
        return "s(u, w), u the {} and w the {}".format(*law.tested)
    place, choice = law_place(law.place), law.choice
    if choice is None or choice.law is None:
        return place if choice is None else term_of(choice).equation
    ((covariate, unit),) = law_covariates(finding).items()
    return f"{place} with s(u) = {choice.law.printed(unit)}, u the {covariate}"


def why_not_named(finding: MachineFinding, name: str) -> str:
    """Say why a term was not named that a law turned out to be."""
    if name in finding.unconfirmed:
        return finding.unconfirmed_since.get(name, NOT_CONFIRMED)
    if name in {choice.name for choice in finding.base.terms}:
        return "the base model has it"
    tried = [step for step in finding.steps if name in {trial.term.choice.name for trial in step.trials}]
    if not tried:
        return "on these records it looks like inertia, gravity or drive"
    return tried[-1].reason or "another one explains more"


def noise_keys(finding: MachineFinding) -> list[str]:
    """Keys of `campaign.yaml` that state the noise of the sensors there are."""
    keys = COLUMNS[finding.base.coordinate]
    moving = "speed" if any(record.summed_up for record in finding.records) else "position"
    return [keys[f"{channel}_noise"] for channel in ("force", moving)[not finding.is_driven :]]


def _conclusion(finding: MachineFinding) -> str:
    before, after = finding.fall.before, finding.fall.after
    if finding.verdict == "untested" and finding.clear_strengths and not finding.noise_is_motion:
        names = enumerated([phrase(one.name) for one in finding.clear_strengths], "or")
        return (
            f"Nothing is named: the held-out gap of {before:.2f} noise floors is at its floor, yet the "
            f"strength of {names} is clear of 0. Record longer, with less noise, or a larger motion."
        )
    if finding.verdict == "untested" and finding.noise_hides and not finding.missing_blocks:
        return (
            f"Nothing can be said: in the equation of motion (gap {before:.2f} noise floors) noise of the "
            "position hides what the simulation shows to be missing. Record with less noise, or a larger or "
            "faster motion."
        )
    if finding.verdict == "untested" and not finding.missing_blocks:
        return (
            f"Nothing can be said: the base model leaves {before:.2f} of what was taken for noise, so that "
            "most of it is motion from one sample to the next. State "
            f"{enumerated(noise_keys(finding), 'and')} of the sensors, or sample faster."
        )
    if finding.verdict == "untested":
        counts = f"{len(finding.training)} to fit and {len(finding.held_out)} held out"
        return (
            f"Too few blocks to say: {counts}, about {finding.missing_blocks} more are needed. The held-out "
            f"gap of the base model is {before:.2f} noise floors."
        )
    if finding.verdict == "no_gap":
        return f"The base model explains these records: the held-out gap is {before:.2f} noise floors."
    if finding.verdict == "unknown":
        said = f"No known term explains a held-out gap of {before:.2f} noise floors"
        if finding.unconfirmed:
            names = enumerated([*map(phrase, finding.unconfirmed)], "and")
            lacks = finding.unconfirmed_since.get(finding.unconfirmed[0], NOT_CONFIRMED)
            said = f"{as_title(names)} would explain what fitted, but {lacks}"
        reason = finding.steps[0].reason if finding.steps else ""
        return f"{said}: {reason}." if reason else f"{said}."
    groups = [
        " or ".join(map(phrase, (name, *finding.tied_with.get(name, ())))) for name in finding.established
    ]
    tied = any(finding.tied_with.values())
    missing = enumerated(groups, "and") + (", which these records cannot tell apart" if tied else "")
    said = f"Missing: {missing}; the held-out gap falls from {before:.2f} to {after:.2f} noise floors."
    return said if finding.is_at_floor else f"{said} Something remains that it does not explain."
