"""Base models: a machine without a cell, in a short YAML, every fault with line and column."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import yaml
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from impactcell.campaign import Coordinate, Excitation
from impactcell.discrepancy.laws import ATOMS as ATOMS_IN_ORDER
from impactcell.discrepancy.laws import Shaped
from impactcell.discrepancy.machine import CATALOGUE, LAW_PLACES, LawForm, NumberPrior, Response, TermChoice
from impactcell.discrepancy.machine import BaseModel as MachineModel
from impactcell.errors import SettingsError
from impactcell.process import yaml_loader, yaml_schema
from impactcell.settings.fields import Positive
from impactcell.settings.uncertain_numbers import Number, NumberOfEach, NumberOfRecords, UncertainNumber

NUISANCES = ("position_offset", "position_eccentricity", "force_offset", "force_gain", "delay_s")
"""What a measurement may be off by, in the order in which it is written."""
HEADER = "# A base model of impactcell: a machine with one coordinate, for `impactcell discrepancy --base`.\n"


ATOMS = {atom.name: atom for atom in ATOMS_IN_ORDER}
"""Functions of u that a law is made of, by their names."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class TermOfColumn(_Part):
    """A term that goes by a column of `shots.csv`."""

    term: str
    covariate: Annotated[str, Field(min_length=1)]


class TermOfLaw(_Part):
    """A function that the catalogue does not have: summands, each a product of atoms with their shapes."""

    term: str
    law: Annotated[list[dict[str, dict[str, FiniteFloat]]], Field(min_length=1)]
    reference: Positive = 1.0


class Nuisances(_Part):
    """What a measurement may be off by; each is 0 and exact where it is not named."""

    position_offset: Number = 0.0
    position_eccentricity: Number = 0.0
    force_offset: NumberOfEach = 0.0
    force_gain: Number = 0.0
    delay_s: Number = 0.0


class BaseModelFile(_Part):
    """A whole base model."""

    format: Literal[1]
    name: Annotated[str, Field(min_length=1)] = "base"
    coordinate: Literal["translation", "rotation"]
    excitation: Literal["free", "driven", "tap"]
    predicts: Literal["position", "force"] = "position"
    mass_kg: Number | None = None
    inertia_kg_m2: Number | None = None
    gravity_torque_n_m: Number = 0.0
    terms: list[str | TermOfColumn | TermOfLaw] = ["coulomb_friction"]
    nuisances: Nuisances = Nuisances()
    block_s: Positive | None = None
    provenance: dict[str, str] = {}

    @model_validator(mode="after")
    def _fits_its_coordinate(self) -> Self:
        if self.excitation == "tap":
            raise ValueError("the base model of a tap is a cell's model: name the cell with --cell instead")
        turns = self.coordinate == "rotation"
        if turns and self.mass_kg is not None:
            raise ValueError("a rotation has inertia_kg_m2 in place of mass_kg")
        if not turns and self.inertia_kg_m2 is not None:
            raise ValueError("a translation has mass_kg in place of inertia_kg_m2")
        if not turns and self.gravity_torque_n_m != 0.0:
            raise ValueError("gravity_torque_n_m, m g l, belongs to a rotation")
        eccentricity = self.nuisances.position_eccentricity
        if not turns and eccentricity != 0.0:
            raise ValueError("position_eccentricity is of an encoder that turns, and belongs to a rotation")
        if (eccentricity.value if isinstance(eccentricity, UncertainNumber) else eccentricity) != 0.0:
            raise ValueError("position_eccentricity is about 0, its phase is free: write {std: ...}")
        if self.excitation == "free" and self.predicts == "force":
            raise ValueError("where nothing drives, predicts is position")
        if self.excitation == "free" and _prior(self.nuisances.force_offset).value != 0.0:
            raise ValueError("where nothing drives, there is no force whose force_offset could be stated")
        return self


def read_base_model(path: Path) -> tuple[MachineModel, Excitation]:
    """Read a base model, and the excitation that its records have to have.

    Raises
    ------
    SettingsError
        Listing every fault as `file:line:column: message`.
    """
    file, positions = yaml_schema.read(path, BaseModelFile)
    faults: list[str] = []
    choices: list[TermChoice] = []
    for number, item in enumerate(file.terms):
        choice = _choice(item)
        fault = _fault_of_law(item) if isinstance(item, TermOfLaw) else _fault_of_term(choice, file.predicts)
        if not fault and choice.name in {other.name for other in choices}:
            fault = f"{choice.name} appears twice"
        if fault:
            faults.append(yaml_loader.format_error(path, positions.value(("terms", number)), fault))
        choices.append(choice)
    faults += [
        yaml_loader.format_error(path, positions.value(location), fault)
        for location, fault in _faults_of_numbers(file)
    ]
    if faults:
        raise SettingsError("\n".join(faults))
    inertia = file.inertia_kg_m2 if file.coordinate == "rotation" else file.mass_kg
    nuisances = file.nuisances
    model = MachineModel(
        coordinate=Coordinate(file.coordinate),
        response=Response(file.predicts),
        inertia=NumberPrior(math.nan) if inertia is None else _prior(inertia),
        gravity_torque=_prior(file.gravity_torque_n_m),
        terms=tuple(choices),
        position_offset=_prior(nuisances.position_offset),
        position_eccentricity=_prior(nuisances.position_eccentricity),
        force_offset=_prior(nuisances.force_offset),
        force_offset_by_record=_is_by_record(nuisances.force_offset),
        force_gain=_prior(nuisances.force_gain),
        delay_s=_prior(nuisances.delay_s),
        block_s=math.nan if file.block_s is None else file.block_s,
        name=file.name,
    )
    return model, Excitation.FREE_SLIDE if file.excitation == "free" else Excitation.DRIVEN


def base_model_text(model: MachineModel, excitation: Excitation, provenance: dict[str, str]) -> str:
    """Write a base model as YAML, so that it can be named with `--base` again."""
    mapping: dict[str, Any] = {
        "format": 1,
        "name": model.name,
        "coordinate": str(model.coordinate),
        "excitation": "free" if excitation is Excitation.FREE_SLIDE else "driven",
        "predicts": str(model.response),
    }
    turns = model.coordinate is Coordinate.ROTATION
    inertia = "inertia_kg_m2" if turns else "mass_kg"
    if math.isfinite(model.inertia.value):
        mapping[inertia] = _number(model.inertia)
    if turns:
        mapping["gravity_torque_n_m"] = _number(model.gravity_torque)
    mapping["terms"] = [_term(choice) for choice in model.terms]
    mapping["nuisances"] = {
        name: _number(getattr(model, name)) for name in NUISANCES if turns or name != "position_eccentricity"
    }
    if model.force_offset_by_record:
        mapping["nuisances"]["force_offset"] = {"std": "free", "each": "record"}
    if math.isfinite(model.block_s):
        mapping["block_s"] = model.block_s
    mapping["provenance"] = provenance
    return HEADER + yaml.safe_dump(mapping, sort_keys=False, allow_unicode=True, width=110)


def _is_by_record(offset: float | NumberOfRecords) -> bool:
    return isinstance(offset, NumberOfRecords) and offset.each is not None


def _faults_of_numbers(file: BaseModelFile) -> Iterator[tuple[yaml_loader.Location, str]]:
    """Say which numbers no machine can have, or no fit can begin with, and where they stand."""
    for name in ("mass_kg", "inertia_kg_m2"):
        number: float | UncertainNumber | None = getattr(file, name)
        if number is None or (prior := _prior(number)).value > 0.0:
            continue
        if not prior.is_held:
            yield (name,), f"{name} needs a value above 0 to begin with: write {{value: ABOUT, std: ...}}"
        elif prior.value < 0.0 or file.predicts == "position":
            yield (name,), f"{name} must be above 0; it may be 0 only with predicts: force, and without a std"
    nuisances = file.nuisances
    if _is_by_record(nuisances.force_offset) and _prior(nuisances.force_offset) != NumberPrior(std=math.inf):
        fault = "what is another one in each record is free: write {std: free, each: record}"
        yield ("nuisances", "force_offset"), fault
    if math.isinf(_prior(nuisances.delay_s).std):
        fault = "delay_s is looked for within twice its std, which has to be finite: write {std: SECONDS}"
        yield ("nuisances", "delay_s"), fault
    if _prior(nuisances.force_gain).value <= -1.0:
        fault = "force_gain is relative and above -1: at -1 nothing is left of the force"
        yield ("nuisances", "force_gain"), fault


def _prior(number: float | UncertainNumber) -> NumberPrior:
    return number.prior() if isinstance(number, UncertainNumber) else NumberPrior(number)


def _number(prior: NumberPrior) -> float | dict[str, float | str]:
    if prior.is_held:
        return prior.value
    return {"value": prior.value, "std": "free" if math.isinf(prior.std) else prior.std}


def _term(choice: TermChoice) -> str | dict[str, Any]:
    """Write a term as it is read."""
    if choice.law is not None:
        parts = [
            {
                atom.name: {shape.name: value for shape, value in zip(atom.shapes, values, strict=True)}
                for atom, values in zip(item.term, item.shapes, strict=True)
            }
            for item in choice.law.terms
        ]
        return {"term": choice.identifier, "law": parts, "reference": choice.law.reference}
    if choice.covariate:
        return {"term": choice.identifier, "covariate": choice.covariate}
    return choice.identifier


def _choice(item: str | TermOfColumn | TermOfLaw) -> TermChoice:
    """Term of a file; atoms and shapes that do not exist are left out, and told as a fault."""
    if isinstance(item, str):
        return TermChoice(item)
    if isinstance(item, TermOfColumn):
        return TermChoice(item.term, item.covariate)
    terms = tuple(
        Shaped(
            tuple(ATOMS[name] for name in part if name in ATOMS),
            tuple(
                tuple(shapes.get(shape.name, 1.0) for shape in ATOMS[name].shapes)
                for name, shapes in part.items()
                if name in ATOMS
            ),
        )
        for part in item.law
    )
    return TermChoice(item.term, law=LawForm(terms, item.reference))


def _fault_of_law(item: TermOfLaw) -> str:
    """Say what is wrong with a law; empty if nothing is."""
    if item.term not in LAW_PLACES:
        return f"no place {item.term!r} for a law; {yaml_loader.suggest(item.term, LAW_PLACES)}"
    for part in item.law:
        for name, shapes in part.items():
            if name not in ATOMS:
                return f"no function {name!r} of u; {yaml_loader.suggest(name, ATOMS)}"
            needed = {shape.name for shape in ATOMS[name].shapes}
            if set(shapes) != needed:
                wants = ", ".join(sorted(needed)) or "no shape"
                return f"{name} takes {wants}, not {', '.join(sorted(shapes)) or 'none'}"
            bad = [shape for shape in needed - {"centre"} if shapes[shape] <= 0.0]
            if bad:
                return f"{name}: {bad[0]} must be above 0"
        if not part:
            return "a summand of a law is at least one function of u"
    return ""


def _fault_of_term(choice: TermChoice, predicts: str) -> str:
    """Say what is wrong with a term of the catalogue; empty if nothing is."""
    identifier, covariate = choice.identifier, choice.covariate
    if identifier not in CATALOGUE:
        return f"no term {identifier!r}; {yaml_loader.suggest(identifier, CATALOGUE)}"
    term = CATALOGUE[identifier]
    if term.needs_covariate and not covariate:
        return f"{identifier} goes by a column of shots.csv: write {{term: {identifier}, covariate: COLUMN}}"
    if covariate and not term.needs_covariate:
        return f"{identifier} goes by no column of shots.csv; take covariate away"
    if term.has_memory and predicts == "position":
        return f"{identifier} follows from the path, and needs predicts: force"
    return ""
