"""`impactcell model accept`: an extended model into service, without losing what the cell has learned."""

import json
import shlex
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

from impactcell.cell import in_place_of
from impactcell.cli.calibrate import calibrated_model
from impactcell.cli.model_changes import model_changes
from impactcell.cli.model_origin import ModelOrigin, origin_of, untold_sentence
from impactcell.cli.own_taps import OwnTaps, compare_on_own_taps
from impactcell.cli.paths import check_output
from impactcell.cli.shared_model import cells_sharing, note_sharing
from impactcell.errors import ImpactCellError, PredictionError, SettingsError
from impactcell.prediction import Model
from impactcell.process.console import print_note, print_result
from impactcell.process.whole_files import write_whole
from impactcell.records.uncertainty import plus_minus
from impactcell.settings import CellConfig, read_cell
from impactcell.settings.judgement import judge_cell
from impactcell.settings.model_file import read_model, write_model

ORIGINS: Final = {"fitted to": "fitted to", "from": "found in", "plant": "plant:"}
"""How a provenance tells where a plant comes from, as it is said: that of `model fit`, of `discrepancy`,
and of a model that comes with the program."""


def accept_model(cell: Path, extended: Path, *, anyway: bool = False, as_json: bool = False) -> None:
    """Calibrate an extended model for the cell and put it in the place of the cell's model file.

    The model that it replaces is kept beside it as `<name>.previous.yaml`. A running service sees the new
    file within a second and goes on with it from the next cycle; tracker, alarms and journal stay. One with
    which the cell's own last taps fit clearly worse, or whose contact nothing tells, is put into service only
    `anyway`. What the investigation established that it comes from is said, with a caution where that is
    nothing or something remains.

    Raises
    ------
    SettingsError
        A file cannot be read or written.
    PredictionError
        The part would not slide free over the calibrated range, the cell's own taps speak against it, or
        nothing tells what its contact is like.
    JournalError
        The cell's journal cannot be read.
    """
    cell_config = read_cell(cell)
    model, own_taps = _judged(cell_config, extended, anyway=anyway)
    is_new = in_place_of(cell_config.model, model) != cell_config.model
    sharing = cells_sharing(cell_config)
    previous = put_into_service(cell_config, model)
    for finding in judge_cell(read_cell(cell)):
        if finding.is_fault:
            print_note(str(finding))
    origin = origin_of(model)
    _tell(
        {
            "cell": cell_config.name,
            "model": model.name,
            "previous": str(previous),
            "shared_with": list(sharing),
            "own_taps": None if own_taps is None else own_taps.content,
            "verdict": None if origin is None else origin.verdict,
            "caution": None if origin is None else origin.caution,
        },
        f"{cell_config.name} runs with model {model.name} "
        + (f"from the next cycle on; before: {previous}" if is_new else "already; nothing was changed")
        + "".join(f"\n{one.sentence}" for one in (own_taps, origin) if one is not None),
        as_json=as_json,
    )
    _note_caution(origin)


def _note_caution(origin: ModelOrigin | None) -> None:
    """Print the caution that goes with what was established as a model was found."""
    if origin is not None and origin.caution:
        print_note(f"caution: {origin.caution}")


def _judged(config: CellConfig, extended: Path, *, anyway: bool) -> tuple[Model, OwnTaps | None]:
    """Calibrate a model for the cell, and look at the cell's own taps with it; nothing is written yet.

    Raises
    ------
    SettingsError, PredictionError, JournalError
        Why it cannot be put into service.
    """
    check_output(previous_model(config.settings.model), SettingsError)
    found = read_model(extended)
    if (nothing_tells := untold_sentence(found, config.model.prior)) and not anyway:
        raise _refusal(config, found, extended, nothing_tells)
    model = calibrated_model(replace(config, model=found))
    own_taps = compare_on_own_taps(config, model)
    if own_taps is not None and own_taps.speaks_against and not anyway:
        raise _refusal(config, model, extended, own_taps.sentence)
    return model, own_taps


def _refusal(config: CellConfig, model: Model, extended: Path, why: str) -> PredictionError:
    """Say that a model is not put into service and why, with the command that would all the same."""
    files = [str(file.absolute()) for file in (config.path, extended)]
    command = shlex.join(["impactcell", "model", "accept", *files, "--anyway"])
    told = f"model {model.name} is not put into service (`{command}` would)"
    return PredictionError(f"{config.name}: {told}: {why}")


def put_into_service(config: CellConfig, model: Model) -> Path:
    """Write a model in the place of the cell's own, and return where that is kept from now on.

    Where it is the cell's own already nothing is written: the way back to the one before stays open. Other
    cells that run with the same file are told.

    Raises
    ------
    SettingsError
        A file cannot be written.
    """
    target = config.settings.model
    previous, taking = previous_model(target), in_place_of(config.model, model)
    if taking == config.model:
        return previous
    _replace(target, taking, previous)
    note_sharing(config, taking, cells_sharing(config))
    return previous


def _replace(target: Path, model: Model, previous: Path) -> None:
    """Write a model in the place of the one in service, which is kept as the previous one; no step loses one.

    Raises
    ------
    SettingsError
        A file cannot be written.
    """
    beside = previous.with_name(f"{previous.name}.new")
    try:
        write_whole(beside, target.read_bytes().decode())
    except OSError as error:
        raise SettingsError(
            f"{previous}: cannot be written: {error.strerror}; nothing was changed: "
            f"let who runs this write in {previous.parent}, and do it again"
        ) from error
    try:
        write_model(model, target)
    except SettingsError:
        beside.unlink(missing_ok=True)
        raise
    try:
        beside.replace(previous)
    except OSError as error:
        raise SettingsError(
            f"{previous}: cannot be written: {error.strerror}; {model.name} is in service, and the model "
            f"before it lies in {beside}: move it there"
        ) from error


def restore_model(cell: Path, *, as_json: bool = False) -> None:
    """Put the previous model back; the one in service takes its place, so that this can be undone as well.

    Raises
    ------
    SettingsError
        There is no previous model, or a file cannot be read or written.
    """
    cell_config = read_cell(cell)
    target = cell_config.settings.model
    previous = previous_model(target)
    if not previous.is_file():
        raise SettingsError(f"{previous}: there is none; nothing has been accepted in this cell")
    model = read_model(previous)
    _replace(target, model, previous)
    note_sharing(cell_config, model, cells_sharing(cell_config))
    if model.is_provisional:
        print_note(
            f"{model.name} is the guess that `impactcell model fit` replaced: nothing of it was measured; "
            f"wear and batches are learned anew by it, and anew once more when you fit again or restore again"
        )
    _tell(
        {"cell": cell_config.name, "model": model.name, "previous": str(previous)},
        f"{cell_config.name} runs with model {model.name} from the next cycle on, as before\n"
        f"{_plant(model)}\n`{shlex.join(['impactcell', 'model', 'restore', str(cell)])}` again undoes it",
        as_json=as_json,
    )


def _plant(model: Model) -> str:
    """Tell a model's parameters with what is told of their standard deviations, and where they come from."""
    plant, prior, said = model.plant, model.prior, model.provenance
    stiffness = plus_minus(plant.stiffness_n_per_m, prior.stiffness_std_n_per_m, ".6g", ".0f")
    damping = plus_minus(plant.damping_n_s_per_m, prior.damping_std_n_s_per_m, ".5g", ".3g")
    ratio = plus_minus(model.ratio, prior.ratio_std, ".4f", ".2g")
    origin = next(
        (f"; {how} {said[key]}" for key, how in ORIGINS.items() if key in said and not model.is_provisional),
        "",
    )
    return f"k {stiffness} N/m, b {damping} N s/m, mu_k/mu_s {ratio} (± is 95 %){origin}"


def compare_models(cell: Path, extended: Path, *, anyway: bool = False, as_json: bool = False) -> None:
    """Say what `model accept` would change, and change nothing; what that refuses is refused here too.

    Raises
    ------
    SettingsError, PredictionError, JournalError
        As `accept_model` would, after the changes are told.
    """
    cell_config = read_cell(cell)
    before, after = cell_config.model, read_model(extended)
    refusal, own_taps = None, None
    try:
        _, own_taps = _judged(cell_config, extended, anyway=anyway)
    except ImpactCellError as error:
        refusal = error
    changes = model_changes(before, after)
    rows = [f"  {change.sentence}" for change in changes]
    origin = origin_of(after)
    rows += [one.sentence for one in (own_taps, origin) if one is not None]
    sharing = cells_sharing(cell_config)
    if sharing:
        rows.append(f"{cell_config.settings.model} is the model file of {', '.join(sharing)} too")
    _tell(
        {
            "cell": cell_config.name,
            "before": before.name,
            "after": after.name,
            "changes": [asdict(change) for change in changes],
            "shared_with": list(sharing),
            "own_taps": None if own_taps is None else own_taps.content,
            "verdict": None if origin is None else origin.verdict,
            "caution": None if origin is None else origin.caution,
            "refused": None if refusal is None else str(refusal),
        },
        "\n".join([f"{cell_config.name}: {before.name} -> {after.name}", *rows]),
        as_json=as_json,
    )
    _note_caution(origin)
    if refusal is not None:
        raise refusal


def previous_model(model_file: Path) -> Path:
    """Where the model is kept that the one in service has replaced."""
    return model_file.with_name(f"{model_file.stem}.previous{model_file.suffix}")


def _tell(content: dict[str, Any], sentence: str, *, as_json: bool) -> None:
    if as_json:
        sys.stdout.write(json.dumps(content) + "\n")
    else:
        print_result(sentence)
