"""What every effect owes: it says what it is, vanishes, stays finite, is smooth, dissipates if it claims to.

The same promises are tested of the library in `tests/contract`; here an effect from outside is held to them.
"""

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from impactcell.errors import PhysicsError
from impactcell.physics.effect import Effect, LawKind, Parameter
from impactcell.physics.effects import LIBRARY, offer_effect, withdraw_effect
from impactcell.physics.ensemble import Ensemble
from impactcell.physics.plant import TapInput
from impactcell.physics.usable_effect import faults_of_use
from impactcell.records import Samples

NOMINAL = np.array([6.5e5, 465.0, 0.2, 0.152])
"""Plant that reproduces the source paper: k [N/m], b [N s/m], mu_s, mu_k."""
TAPS = tuple(
    TapInput(v, m, 1.5e-3, direction=d, start_m=0.001, dwell_s=30.0, shot=3, shots=10, batch=b)
    for v, m, d, b in (
        (0.02, 18.9, 1, 0),
        (0.04, 12.6, -1, 1),
        (0.06, 18.9, 1, 2),
        (0.1, 25.2, -1, 1),
        (0.1, 5.0, 1, 0),
    )
)
"""Taps on which an effect has to show: slow and fast, light and heavy, both directions, three batches."""
TIMES: Samples = np.arange(0, 1300, dtype=np.float64) * 1.0003e-4
"""Times of samples [s], none of which lies on an event."""
SCALES = (300.0, 5e-3, 1e-3)
"""Force [N], position and actuator [m] of a tap: residuals are told in them."""
VANISHING = 2e-9
"""Difference to the plant without it, over those scales, below which an effect has vanished."""
SHOWING = 1e-3
"""Difference above which it shows."""
CONVERGING = 1e-4
"""Change of a derivative, over its largest value, between difference steps of 1e-5 and 1e-6: more is no
derivative."""
RANGE_DRAWS = 8
"""Places in the range of the parameters at which a tap has to stay finite, beside its two ends."""
WIDEST = 30.0
"""Multiple and part of the typical value to which those draws reach."""
ARGUMENTS = (1e-3, 1e-2, 18.9, 9.81)
"""Four numbers at which any law has to have a value: small, positive, and the last two mass and gravity."""
ENERGY_DRAWS = 2000
"""Places at which the sign of the power is looked at."""


def contract_faults(effect: Effect) -> list[str]:
    """Say what of the contract an effect breaks; an empty list is the answer one hopes for."""
    faults = [*faults_of_use(effect), *_documentation(effect)]
    if faults:
        return faults
    is_new = effect.identifier not in LIBRARY
    if is_new:
        offer_effect(effect)
    try:
        return [
            *_vanishing(effect), *_unknown_columns(effect), *_range(effect), *_smoothness(effect),
            *_energy(effect),
        ]  # fmt: skip
    except PhysicsError as error:
        return [f"a tap with it cannot be simulated: {error}"]
    finally:
        if is_new:
            withdraw_effect(effect.identifier)


def _documentation(effect: Effect) -> list[str]:
    functions: list[Callable[..., object]] = [*effect.laws.values()]
    if effect.between is not None:
        functions.append(effect.between)
    faults = [
        f"its law {f.__name__} has no docstring that gives the formula"
        for f in functions
        if not inspect.getdoc(f)
    ]
    module = inspect.getmodule(functions[0]) if functions else None
    if module is not None and not (module.__doc__ or "").strip():
        faults.append("its file has no docstring that says what it is in a sentence")
    return faults


def _values(effect: Effect, choose: Callable[[Parameter], float]) -> list[float]:
    values: list[float] = []
    for parameter in effect.parameters:
        values += [choose(parameter)] * (2 if parameter.per_batch else 1)
    return values


def _ensemble(*identifiers: str, columns: Mapping[str, tuple[float, float]] | None = None) -> Ensemble:
    times = [TIMES] * len(TAPS)
    given = {name: np.linspace(*ends, len(TAPS)).tolist() for name, ends in (columns or {}).items()}
    taps = [
        replace(tap, columns=tuple((name, values[i]) for name, values in given.items()))
        for i, tap in enumerate(TAPS)
    ]
    return Ensemble(taps, identifiers, force_time_s=times, position_time_s=times, actuator_time_s=times)


def _traces(model: Ensemble, values: list[float]) -> Samples:
    traces = model.traces(np.concatenate([NOMINAL, values]))
    channels = (traces.force_n, traces.position_m, traces.actuator_m)
    return np.concatenate([channel / scale for channel, scale in zip(channels, SCALES, strict=True)])


def _with(effect: Effect) -> Ensemble:
    """Taps with an effect, its columns gone through."""
    return _ensemble(effect.identifier, columns=effect.columns)


def _middle(effect: Effect) -> list[float]:
    """Middle of the range of each column that an effect reads."""
    return [0.5 * (low + high) for low, high in effect.columns.values()]


def _unknown_columns(effect: Effect) -> list[str]:
    if not effect.columns:
        return []
    unknown = _traces(_ensemble(effect.identifier), _values(effect, lambda p: p.typical))
    if not np.abs(unknown - _traces(_ensemble(), [])).max() <= VANISHING:
        return [f"it still moves a tap where {' and '.join(effect.columns)} is not known (nan)"]
    return []


def _vanishing(effect: Effect) -> list[str]:
    without, model = _traces(_ensemble(), []), _with(effect)
    null = _traces(model, _values(effect, lambda p: p.typical if math.isnan(p.null) else p.null))
    typical = _traces(model, _values(effect, lambda p: p.typical))
    faults = []
    if not np.abs(null - without).max() <= VANISHING:
        faults.append(
            f"it does not vanish at its null values: it still moves a tap by "
            f"{np.abs(null - without).max():.2g}"
        )
    if not np.abs(typical - without).max() > SHOWING:
        faults.append(
            f"at its typical values it moves a tap by {np.abs(typical - without).max():.2g} only; more "
            f"than 0.1 % shows"
        )
    return faults


def _range(effect: Effect) -> list[str]:
    rng, model = np.random.default_rng(3), _with(effect)

    def draw(p: Parameter) -> float:
        low = max(p.lower, p.typical / WIDEST if p.lower >= 0.0 else p.lower)
        return float(rng.uniform(low, min(p.upper, max(WIDEST * p.typical, low))))

    places = [_values(effect, lambda p: p.lower), _values(effect, lambda p: p.upper)]
    places += [_values(effect, draw) for _ in range(RANGE_DRAWS)]
    for values in places:
        shown = ", ".join(f"{value:.4g}" for value in values)
        for kind, law in effect.laws.items():
            try:
                with np.errstate(all="ignore"):
                    is_finite = math.isfinite(law(*ARGUMENTS, np.array([*values, *_middle(effect)])))
            except ArithmeticError:
                is_finite = False
            is_finite = is_finite or not np.isfinite(values).all()  # an end at infinity means it
            if not is_finite:
                return [f"its law {law.__name__} ({kind.name}) is not finite at {shown}, within its range"]
        if not np.isfinite(_traces(model, values)).all():
            return [f"a tap with it is not finite at {shown}, within its range"]
    return []


def _smoothness(effect: Effect) -> list[str]:
    model = _with(effect)
    theta = np.concatenate([NOMINAL, _values(effect, lambda p: p.typical)])
    coarse, fine = (
        np.concatenate(
            [
                (channel / scale).ravel()
                for channel, scale in zip(
                    (traces.force_n, traces.position_m, traces.actuator_m), SCALES, strict=True
                )
            ]
        )
        for traces in (
            model.sensitivities(theta, model.names[4:], relative_step=step) for step in (1e-5, 1e-6)
        )
    )
    if not np.isfinite(fine).all():
        return ["its derivatives are not finite at its typical values"]
    # Away from the few samples that an event passes over within the step.
    miss = float(np.quantile(np.abs(coarse - fine), 0.99))
    if not miss < CONVERGING * np.abs(fine).max():
        return ["its derivatives do not converge at its typical values: let nothing switch inside a law"]
    return []


def _energy(effect: Effect) -> list[str]:
    """Look whether a law that claims to take energy ever gives any."""
    if not effect.dissipates:
        return []
    rng = np.random.default_rng(4)
    for kind, law in effect.laws.items():
        if kind not in (LawKind.BODY, LawKind.KINETIC, LawKind.CONTACT):
            return [f"it claims to dissipate, which a law of kind {kind.name} cannot; say dissipates=False"]
        for _ in range(ENERGY_DRAWS):
            p = np.array(
                [rng.uniform(max(q.lower, 1e-6), min(q.upper, 1e6)) for q in effect.parameters]
                + [rng.uniform(*ends) for ends in effect.columns.values()]
            )
            rate = float(rng.uniform(-2.0, 2.0))
            where = ""
            if kind is LawKind.BODY:
                place = float(rng.uniform(-1.0, 1.0))
                where = f" at x = {place:.3g} m"
                gives = law(place, rate, 18.9, 9.81, p) * rate > 0.0
            elif kind is LawKind.KINETIC:
                gives = law(abs(rate), 0.0, 0.0, 0.0, p) < 0.0
            else:
                gives = law(float(rng.uniform(0.0, 1e-2)), rate, 6.5e5, 465.0, p) * rate < 0.0
            if gives:
                shown = ", ".join(f"{value:.4g}" for value in p)
                told = f"it claims to dissipate, and gives energy{where} at {rate:.3g} m/s with {shown}"
                return [f"{told}; say dissipates=False"]
    return []
