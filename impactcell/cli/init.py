"""`impactcell init`: the files of an own cell, each with what it needs, from a few answers."""

import contextlib
import math
import shlex
import shutil
import statistics
import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final

import typer
import yaml

from impactcell.api.first_model import fit_first_model
from impactcell.campaign import Campaign, read
from impactcell.cli.calibrate import calibrated_model
from impactcell.cli.first_model import say_first_model
from impactcell.cli.paths import check_directory, kind_of
from impactcell.errors import PredictionError, SettingsError
from impactcell.features import noise_std
from impactcell.physics import Plant
from impactcell.prediction import PROVISIONAL, Model
from impactcell.prediction.model import Prior
from impactcell.process.console import print_note, print_result
from impactcell.process.path_kind import Kind
from impactcell.process.shipped import shipped_config
from impactcell.records.plausible_range import STROKE
from impactcell.settings import read_cell, read_register_map
from impactcell.settings.fields import cell_name, module_host
from impactcell.settings.judgement import judge_cell
from impactcell.settings.model_file import write_model
from impactcell.settings.plausible_tap import FRICTION, MASS, VELOCITY

PROVISIONAL_STIFFNESS: Final = 6.5e5
"""k of the paper's prototype, N/m: a beginning where nothing was measured."""
PROVISIONAL_DAMPING: Final = 465.0
"""b of the paper's prototype, N s/m."""
PROVISIONAL_RATIO: Final = 0.76
"""mu_k/mu_s of the paper's prototype."""
PROVISIONAL_ERROR: Final = 0.5
"""Relative standard deviation of what is only a beginning."""
FRICTION_BELOW_LIMIT: Final = 0.8
"""Friction of a provisional model, of the wear limit."""
TOP: Final = """\
# A cell of impactcell, begun by `impactcell init`; `impactcell schema` tells every key there is.
"""


@dataclass(frozen=True, slots=True)
class Answers:
    """What a cell is begun with; the help of each is what is asked for.

    Attributes
    ----------
    register_map : str
        A map file, or the name of one that comes with the program.
    force_noise_n, position_noise_um : float
        One standard deviation; 0 where nobody knows.
    """

    name: str
    host: str
    port: int
    register_map: str
    mass_kg: float
    stroke_mm: float
    max_velocity_mm_per_min: float
    wear_limit: float
    force_noise_n: float
    position_noise_um: float


QUESTIONS: Final[dict[str, tuple[str, Any]]] = {
    "name": ("Name of the cell", "press-1"),
    "host": ("Address of its module", "127.0.0.1"),
    "port": ("Modbus TCP port", 502),
    "register_map": ("Register map: a file, or fpga-v1", "fpga-v1"),
    "mass_kg": ("Mass of the part, kg", None),
    "stroke_mm": ("Stroke of the actuator from first contact on, mm", None),
    "max_velocity_mm_per_min": ("Fastest tap, mm/min", 6000.0),
    "wear_limit": ("mu_s at which the surface counts as worn", None),
    "force_noise_n": ("Noise of its force sensor, one standard deviation in N (0: not known)", 0.0),
    "position_noise_um": ("Noise of its position sensor, one standard deviation in µm (0: not known)", 0.0),
}
"""What is asked for, and what is taken where nobody can be asked; None has to be said."""


def ask(given: dict[str, Any]) -> Answers:
    """Complete what was given on the command line: asked on a terminal, else by default.

    Raises
    ------
    SettingsError
        Something has to be said and nobody can be asked.
    """
    missing = [key for key, (_, default) in QUESTIONS.items() if given.get(key) is None and default is None]
    if missing and not sys.stdin.isatty():
        options = ", ".join(f"--{key.replace('_', '-')}" for key in missing)
        raise SettingsError(f"init needs {options}; on a terminal it asks")
    values: dict[str, Any] = {}
    kinds = {field.name: field.type for field in fields(Answers)}
    for key, (question, default) in QUESTIONS.items():
        value = given.get(key)
        if value is None and sys.stdin.isatty():
            value = typer.prompt(question, default=default, type=kinds[key])
        values[key] = default if value is None else value
    return Answers(**values)


def init(directory: Path, answers: Answers, campaign: Path | None) -> None:
    """Write cell, map and model into a directory; nothing that is there is replaced.

    Raises
    ------
    SettingsError
        A file is there already, or cannot be written, or an answer makes no cell.
    CampaignError, PredictionError
        No model can be fitted to the campaign.
    """
    for option, see, value in (("name", cell_name, answers.name), ("host", module_host, answers.host)):
        try:
            see(value)
        except ValueError as error:
            raise SettingsError(f"--{option} {value!r}: {error}") from error
    check_directory(directory, SettingsError)
    source = _map_file(answers.register_map)
    read_register_map(source)  # what is wrong with it is told of the user's own file
    cell, model = directory / f"{answers.name}.yaml", directory / f"{answers.name}.model.yaml"
    target_map = directory / source.name
    if target_map in (cell, model):  # each keeps its own name
        target_map = directory / f"{source.stem}.map.yaml"
    for path in (cell, model):
        if path.exists():
            raise SettingsError(f"{path}: is there already; name another directory or another cell")
    has_map = target_map.exists()
    if has_map and target_map.read_bytes() != source.read_bytes():
        raise SettingsError(f"{target_map}: is there already, and is another map than {source}")
    first = None
    if campaign is not None:
        taps = read(campaign)
        first, answers = (
            fit_first_model(taps, answers.name, campaign.name),
            _with_measured_noise(answers, taps),
        )
    text = TOP + yaml.safe_dump(_cell(answers, target_map), sort_keys=False)
    begun = [cell, model, *([] if has_map else [target_map])]
    made = [part for part in (directory, *directory.parents) if not part.exists()]
    try:
        directory.mkdir(parents=True, exist_ok=True)
        if not has_map:
            shutil.copyfile(source, target_map)
        cell.write_text(text, encoding="utf-8")
    except OSError as error:
        _take_back(begun, made)
        raise SettingsError(f"{error.filename or directory}: cannot be written: {error.strerror}") from error
    try:
        write_model(provisional_model(answers) if first is None else first.fit.model, model)
        config = read_cell(cell)
        print_note(
            f"{answers.name}: calibrating the equations of friction for its mass and stroke, some seconds"
        )
        write_model(calibrated_model(config), model)
        findings = judge_cell(read_cell(cell))
    except Exception as error:
        _take_back(begun, made)
        if isinstance(error, PredictionError) and (doubts := _doubts(answers)):
            raise PredictionError("; ".join([str(error), *doubts])) from error
        raise
    for finding in findings:
        print_note(str(finding))
    print_result(f"{cell}, {target_map.name} and {model.name} are written")
    if first is not None:
        say_first_model(first, model)
    print_result(_next_steps(cell, directory, is_provisional=first is None))


def _take_back(files: Sequence[Path], directories: Sequence[Path]) -> None:
    """Remove files, and directories, the innermost first: what was not begun whole is not begun."""
    with contextlib.suppress(OSError):
        for file in files:
            file.unlink(missing_ok=True)
        for directory in directories:
            directory.rmdir()


def provisional_model(answers: Answers) -> Model:
    """Give a model that nothing was measured of: enough to record taps with, and told to be no more."""
    mu_s = FRICTION_BELOW_LIMIT * answers.wear_limit
    plant = Plant(PROVISIONAL_STIFFNESS, PROVISIONAL_DAMPING, mu_s, PROVISIONAL_RATIO * mu_s)
    prior = Prior(
        PROVISIONAL_ERROR * PROVISIONAL_STIFFNESS,
        PROVISIONAL_ERROR * PROVISIONAL_DAMPING,
        PROVISIONAL_ERROR * PROVISIONAL_RATIO,
    )
    note = "nothing measured: figures of the paper's prototype; run `impactcell model fit` after 30 taps"
    return Model(
        f"{answers.name}-provisional",
        plant,
        prior,
        stroke_m=answers.stroke_mm * 1e-3,
        provenance={"made by": "impactcell init", PROVISIONAL: note},
    )


def _with_measured_noise(answers: Answers, taps: Campaign) -> Answers:
    """Complete the noise of the sensors, where it was not said, by what the taps of a campaign show."""
    force, position = (
        statistics.median(noise_std(channel) for channel in channels) if channels else 0.0
        for channels in (
            [shot.force for shot in taps.shots if shot.force is not None],
            [shot.position for shot in taps.shots if shot.position is not None],
        )
    )
    return replace(
        answers,
        force_noise_n=answers.force_noise_n or force,
        position_noise_um=answers.position_noise_um or 1e6 * position,
    )


def _map_file(name: str) -> Path:
    for path in (Path(name), shipped_config() / "maps" / f"{name}.yaml"):
        if kind_of(path, SettingsError) is Kind.FILE:
            return path
    known = ", ".join(sorted(path.stem for path in (shipped_config() / "maps").glob("*.yaml")))
    raise SettingsError(f"there is no register map {name}; name a file, or one of {known}")


def _doubts(answers: Answers) -> list[str]:
    """Say which answers are hardly meant, and in which unit they would be."""
    said = (
        ("mass-kg", MASS, answers.mass_kg),
        ("stroke-mm", STROKE, answers.stroke_mm),
        ("max-velocity-mm-per-min", VELOCITY, answers.max_velocity_mm_per_min),
        ("wear-limit", FRICTION, answers.wear_limit),
    )
    return [f"--{option}: {doubt}" for option, plausible, value in said if (doubt := plausible.doubt(value))]


def _cell(answers: Answers, target_map: Path) -> dict[str, Any]:
    for option in ("mass_kg", "stroke_mm", "wear_limit"):
        value = getattr(answers, option)
        if not (math.isfinite(value) and value > 0.0):
            raise SettingsError(f"--{option.replace('_', '-')} {value:g}: has to be above 0")
    noise = {"force_noise_std_n": answers.force_noise_n, "position_noise_std_um": answers.position_noise_um}
    if not all(math.isfinite(std) and std >= 0.0 for std in noise.values()):
        raise SettingsError("the noise of a sensor has to be above 0; leave it out, or say 0, if not known")
    sensors = {key: float(f"{std:.3g}") for key, std in noise.items() if std > 0.0}
    return {
        "format": 1,
        "cell": answers.name,
        "module": {"host": answers.host, "port": answers.port, "register_map": target_map.name},
        "model": f"{answers.name}.model.yaml",
        "part": {"mass_kg": answers.mass_kg},
        "actuator": {
            "stroke_mm": answers.stroke_mm,
            "max_stroke_mm": answers.stroke_mm,
            "max_velocity_mm_per_min": answers.max_velocity_mm_per_min,
        },
        **({"sensors": sensors} if sensors else {}),
        "alarms": {"wear_limit": answers.wear_limit},
        "opcua": {"users_file": "users.yaml", "certificates_dir": "pki"},
        "journal": {"file": f"{answers.name}.sqlite"},
    }


def _next_steps(cell_file: Path, directory: Path, *, is_provisional: bool) -> str:
    cell, users = (shlex.quote(str(file)) for file in (cell_file, directory / "users.yaml"))
    steps = [
        f"impactcell probe {cell}        # what the module says, read as the map has it",
        f"impactcell users add {users} NAME --role engineer    # asks for a password",
        f"impactcell run {cell}          # then open http://127.0.0.1:8480",
    ]
    if is_provisional:
        steps.append(f"impactcell model fit {cell}    # after 30 taps: the cell's own k, b and mu_k/mu_s")
    return "next:\n" + "\n".join(f"  {step}" for step in steps)
