"""From a plant with effects and a tap to the flat arrays that compiled code works on."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from operator import attrgetter

import numpy as np

from impactcell.errors import PhysicsError
from impactcell.numerics.jit import IntArray, address
from impactcell.numerics.stated_numbers import one_number
from impactcell.physics import memory_layout as at
from impactcell.physics.effect import Covariates, Effect, LawKind
from impactcell.physics.effects import find_effect
from impactcell.physics.plant import Plant, TapInput
from impactcell.records import Samples

_TYPICAL_OF_NOMINAL = {"stiffness_n_per_m": 6.5e5, "damping_n_s_per_m": 465.0, "mu_s": 0.2, "mu_k": 0.15}
"""Typical magnitudes of the nominal parameters, about those of the paper's plant."""
NOMINAL_PARAMETERS = tuple(_TYPICAL_OF_NOMINAL)
"""What a plant has beside its effects, in the order of every vector of parameters."""
MAX_EFFECT_STATES = at.STATE_WIDTH - at.FIRST_EXTRA_STATE
_TAP_COLUMNS = (
    *("velocity_m_s", "mass_kg", "stroke_m", "direction", "halts_at_separation", "start_m", "dwell_s"),
    *("shot", "shots", "batch"),
)
"""Fields of a tap that laws and parameters may ask for."""
_TAP_FIELDS = attrgetter(*_TAP_COLUMNS)


@dataclass(frozen=True, slots=True, eq=False)
class LawTable:
    """Effects at work, their laws as compiled code finds them, and where their parameters lie.

    Attributes
    ----------
    names : tuple of str
        Parameters in the order of a parameter vector: the nominal four, then `effect.parameter`, with
        `[1]`, `[2]`, ... behind it where there is one for each batch after the first.
    laws : ndarray
        See `impactcell.physics.memory_layout`.
    width : int
        Numbers of a tap.
    places : ndarray
        Where in them the parameters of the effects lie, in the order of `names[4:]`.
    column_places : tuple of int
        Of each effect, where the shot's values of the columns that its laws read begin; 0 where none do.
    """

    effects: tuple[Effect, ...]
    batches: int
    names: tuple[str, ...]
    parameter_spans: tuple[tuple[tuple[int, int], ...], ...]
    laws: IntArray
    width: int
    places: IntArray
    column_places: tuple[int, ...]

    def __reduce__(self) -> tuple[object, ...]:
        """Travel to another process by name: addresses of laws mean nothing there."""
        return build_law_table, (tuple(effect.identifier for effect in self.effects), self.batches)

    def tap_parameters(self, values: Samples, gravity_m_s2: float, taps: Mapping[str, Samples]) -> Samples:
        """Parameters of taps, shape (n, width), of values, shape (n, len(names)), and the taps' columns."""
        n = values.shape[0]
        parameters = np.empty((n, self.width))
        parameters[:, at.STIFFNESS : at.MU_K + 1] = values[:, :4]
        parameters[:, at.MASS] = taps["mass_kg"]
        parameters[:, at.GRAVITY] = gravity_m_s2
        parameters[:, at.VELOCITY] = taps["velocity_m_s"]
        parameters[:, at.STROKE] = taps["stroke_m"]
        parameters[:, at.DIRECTION] = taps["direction"]
        parameters[:, at.START] = taps["start_m"]
        parameters[:, at.HALTS_AT_SEPARATION] = taps["halts_at_separation"]
        parameters[:, at.INITIAL_SPEED] = taps["initial_speed_m_s"]
        parameters[:, self.places] = values[:, 4:]
        self._set_columns(parameters, taps)
        shots: Covariates | None = None
        for effect, spans in zip(self.effects, self.parameter_spans, strict=True):
            if effect.between is None:
                continue
            if shots is None:
                shots = Covariates(
                    taps["dwell_s"], taps["shot"], taps["shots"], taps["batch"], taps["direction"]
                )
            unknown = np.full(n, np.nan)
            further = _columns_of(effect, taps, unknown)
            columns = [
                values[:, begin:end] if parameter.per_batch else values[:, begin]
                for (begin, end), parameter in zip(spans, effect.parameters, strict=True)
            ]
            factors = effect.between(columns, shots._replace(columns=further))
            parameters[:, at.MU_S] *= factors.mu_s
            parameters[:, at.MU_K] *= factors.mu_k
            parameters[:, at.MASS] *= factors.mass
        return parameters

    def _set_columns(self, parameters: Samples, taps: Mapping[str, Samples]) -> None:
        """Hand laws the shots' values of their columns; where one is not known the effect is at its null."""
        entries = zip(self.effects, self.parameter_spans, self.column_places, strict=True)
        for effect, spans, begin in entries:
            if not begin:
                continue
            given = _columns_of(effect, taps, np.full(len(parameters), np.nan))
            known = np.isfinite(np.column_stack(list(given.values()))).all(axis=1)
            for place, (name, column) in enumerate(given.items(), begin):
                lower = effect.columns[name][0]
                parameters[:, place] = np.where(known, column, lower if math.isfinite(lower) else 0.0)
            for (first, last), parameter in zip(spans, effect.parameters, strict=True):
                if not math.isnan(parameter.null):
                    parameters[~known, begin - spans[-1][1] + first : begin - spans[-1][1] + last] = (
                        parameter.null
                    )


def build_law_table(effects: tuple[str, ...], batches: int = 1) -> LawTable:
    """Lay out the laws and parameters of a set of effects, in their given order.

    Raises
    ------
    PhysicsError
        For an effect that the library does not have, or one named twice.
    """
    if len(set(effects)) != len(effects):
        raise PhysicsError(f"an effect is named twice among {', '.join(effects)}")
    return _law_table(tuple(find_effect(identifier) for identifier in effects), batches)


@lru_cache(maxsize=256)
def _law_table(effects: tuple[Effect, ...], batches: int) -> LawTable:
    names = list(NOMINAL_PARAMETERS)
    spans: list[tuple[tuple[int, int], ...]] = []
    column_places: list[int] = []
    places: list[int] = []
    width = at.FIRST_EFFECT_PARAMETER
    lists: dict[int, list[tuple[int, int, int]]] = {kind: [] for kind in range(at.LAW_KINDS)}
    for effect in effects:
        spans_of_effect: list[tuple[int, int]] = []
        named = len(names)
        for parameter in effect.parameters:
            begin = len(names)
            if parameter.per_batch:
                names += [f"{effect.identifier}.{parameter.name}[{i}]" for i in range(1, batches)]
            else:
                names.append(f"{effect.identifier}.{parameter.name}")
            spans_of_effect.append((begin, len(names)))
        spans.append(tuple(spans_of_effect))
        first, numbers = width, len(names) - named
        places += range(first, first + numbers)
        has_columns = bool(effect.laws and effect.columns)
        column_places.append(first + numbers if has_columns else 0)
        width += numbers + (len(effect.columns) if has_columns else 0)
        for place, law in effect.laws.items():
            lists[int(place)].append((effect.order, address(law), first))
    for single in (LawKind.REACH, LawKind.LAG, LawKind.POSITION_LAG, LawKind.DELAY, LawKind.STICK):
        if len(lists[single]) > 1:
            raise PhysicsError(f"two effects both set the plant's {single.name.lower()}; use one of them")
    if len(lists[LawKind.LOSS]) > MAX_EFFECT_STATES:
        raise PhysicsError(f"at most {MAX_EFFECT_STATES} effects with a state of their own")
    starts: list[int] = []
    entries: list[int] = []
    for kind in range(at.LAW_KINDS):
        starts.append(at.LAW_KINDS + 1 + len(entries))
        for _, where, first in sorted(lists[kind], key=lambda entry: entry[0]):
            entries += [where, first]
    starts.append(at.LAW_KINDS + 1 + len(entries))
    return LawTable(
        effects=effects,
        batches=batches,
        names=tuple(names),
        parameter_spans=tuple(spans),
        laws=np.array(starts + entries, dtype=np.int64),
        width=width,
        places=np.array(places, dtype=np.int64),
        column_places=tuple(column_places),
    )


def _columns_of(effect: Effect, taps: Mapping[str, Samples], unknown: Samples) -> dict[str, Samples]:
    """Give the columns of `shots.csv` that an effect reads, each of shape (n,); nan where not known."""
    return {name: taps.get(column_key(name), unknown) for name in effect.columns}


def parameter_vector(plant: Plant, program: LawTable, batches: int = 1) -> Samples:
    """Parameters of `plant` in the order of `program.names`; effects it lacks are at their null value.

    Raises
    ------
    PhysicsError
        For a parameter that its effect does not have, one that is no number or out of its range, or a wrong
        number of batches.
    """
    values = [plant.stiffness_n_per_m, plant.damping_n_s_per_m, plant.mu_s, plant.mu_k]
    for effect in program.effects:
        given = plant.effects.get(effect.identifier, {})
        unknown = set(given) - {parameter.name for parameter in effect.parameters}
        if unknown:
            raise PhysicsError(
                f"{effect.identifier} has no parameter {', '.join(sorted(unknown))}; "
                f"it has {', '.join(parameter.name for parameter in effect.parameters)}"
            )
        for parameter in effect.parameters:
            neutral = parameter.typical if math.isnan(parameter.null) else parameter.null
            value, name = given.get(parameter.name, neutral), f"{effect.identifier}: {parameter.name}"
            row = value if isinstance(value, Sequence | np.ndarray) and parameter.per_batch else (value,)
            several = [one_number(name, each, PhysicsError) for each in row]
            if parameter.per_batch:
                several += [neutral] * (batches - 1 - len(several))
                several = several[: batches - 1]
            for number in several:
                if not parameter.lower <= number <= parameter.upper:
                    raise PhysicsError(
                        f"{name} is {number}, outside "
                        f"{parameter.lower:g} to {parameter.upper:g} {parameter.unit}"
                    )
            values += several
    return np.array(values, dtype=np.float64)


def tap_columns(taps: Sequence[TapInput]) -> dict[str, Samples]:
    """Columns of `LawTable.tap_parameters`, each of shape (n,), of taps that strike: no initial speed."""
    rows = np.array([_TAP_FIELDS(tap) for tap in taps], dtype=np.float64).reshape(-1, len(_TAP_COLUMNS))
    columns = dict(zip(_TAP_COLUMNS, np.ascontiguousarray(rows.T), strict=True))
    columns["initial_speed_m_s"] = np.full(len(taps), np.nan)
    further = [dict(tap.columns) for tap in taps]
    for name in dict.fromkeys(name for known in further for name in known):
        columns[column_key(name)] = np.array([known.get(name, np.nan) for known in further])
    return columns


def column_key(name: str) -> str:
    """Name of a further column of `shots.csv` among the columns of taps: it cannot be one of theirs."""
    return f"shots.csv/{name}"


def parameter_range(name: str) -> tuple[float, float, float]:
    """Lower and upper end of a parameter's range, and its typical magnitude, by its name in `names`.

    Raises
    ------
    PhysicsError
        No parameter is called so.
    """
    if name in _TYPICAL_OF_NOMINAL:
        return 0.0, math.inf, _TYPICAL_OF_NOMINAL[name]
    identifier, _, rest = name.partition(".")
    for parameter in find_effect(identifier).parameters:
        if parameter.name == rest.partition("[")[0]:
            return parameter.lower, parameter.upper, parameter.typical
    raise PhysicsError(f"no parameter is called {name}")
