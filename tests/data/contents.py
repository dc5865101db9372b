"""What a journal holds, in plain words: to be compared with what the code that wrote it said."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from impactcell import alarms
from impactcell.cell import CellState
from impactcell.journal.history import HistoryQuery
from impactcell.journal.store import Journal
from impactcell.journal.stored_forms import StoredState, unpack_state
from impactcell.positioning.model_hypotheses import parts_of
from impactcell.positioning.planner_posterior import PARAMETERS
from impactcell.records import Alarm
from impactcell.tracking.model_gap.gap_cusum import GapState
from impactcell.tracking.signature.tracker import SignatureState
from impactcell.tracking.wear_batch import TrackerState


def stored(journal: Journal) -> StoredState:
    """The state as it is stored."""
    initial = alarms.initial_state(alarms.AlarmSettings())
    nothing = CellState(TrackerState(), SignatureState(), GapState(), initial)
    return unpack_state(journal.state() or b"", nothing)


def described(durable: StoredState, journal: Journal) -> dict[str, Any]:
    """All that an installed cell has learned and been told; floats exactly, as `float.hex`."""
    assert durable.snapshot is not None
    assert durable.planner is not None
    position = journal.last_cycle_id()
    assert position is not None
    return {
        "last durable cycle": {"session": position.session, "cycle": position.cycle},
        "cycles": journal.count(),
        "captures": sum(1 for _ in journal.captures()),
        "cycle": _cycle(durable),
        "wear and batch": _wear_and_batch(durable),
        "signature": _signature(durable),
        "model gap": _model_gap(durable),
        "alarms": _alarms(durable),
        "planner": _planner(durable),
        "last snapshot": _snapshot(durable),
        "transitions of alarms": [_alarm(alarm) for alarm in journal.alarms(HistoryQuery()).entries],
        "audit": [
            {"time_ns": e.time_ns, "user": e.user, "action": e.action, "with": e.arguments, "came": e.result}
            for e in journal.audit()
        ],
    }


def _cycle(durable: StoredState) -> dict[str, Any]:
    state = durable.cell
    person = state.batch.by_operator
    assert person is not None
    return {
        "number": state.cycle,
        "time_ns": state.time_ns,
        "period_s": state.period_s.hex(),
        "batch named by the module": state.batch.by_module,
        "batch named by a person": {
            "id": person.batch_id,
            "while the module says": person.module_batch_id,
            "expected": person.expected,
        },
        "announcement seen": state.batch.last_announcement,
        "signature grid": {"length_m": state.grid[0].hex(), "points": state.grid[1]},
    }


def _wear_and_batch(durable: StoredState) -> dict[str, Any]:
    state = durable.cell.tracker
    known, shift = state.filter, state.change_point
    assert known is not None
    assert shift is not None
    return {
        "known batches": list(known.batches),
        "present batch": known.current,
        "level, rate and offsets": _floats(known.mean),
        "their covariance": _floats(known.covariance),
        "run-length hypotheses": {"shape": list(state.bank.shape), "numbers": _floats(state.bank)},
        "outliers": _floats(state.outliers),
        "last shift": {
            "cycle": shift.cycle,
            "size": shift.size.hex(),
            "size_std": shift.size_std.hex(),
            "found at": shift.detected_at,
            "statistic": shift.statistic.hex(),
            "threshold": shift.threshold.hex(),
        },
        "clock": {
            "base": state.clock.base,
            "last": state.clock.last,
            "seen": list(state.clock.seen),
            "time_ns": state.clock.time_ns,
            "period_s": state.clock.period_s.hex(),
        },
        "noise": {
            "factor": state.noise.factor.hex(),
            "weight": state.noise.weight.hex(),
            "usual_std": state.noise.usual_std.hex(),
            "last": _floats([state.noise.last_value, state.noise.last_std]),
            "identical": state.noise.identical,
            "posterior": _floats(state.noise.exponent_posterior),
        },
        "batch as the PLC names it": [state.batch_id, state.previous_batch],
        "batches so far": state.batch_count,
        "batch since": state.batch_start,
        "shifts reported at": [state.accepted, state.accepted_before],
        "first cycle": state.first_index,
        "process noise": _floats([state.level_variance, state.slope_variance]),
    }


def _signature(durable: StoredState) -> dict[str, Any]:
    state = durable.cell.signature
    reference, variation = state.reference, state.reference.variation
    return {
        "batch": state.batch_id,
        "deviant cycles in a row": state.deviant_run,
        "cycles of this material": reference.weight.hex(),
        "mean": _floats(reference.mean),
        "information": {"matrix": _floats(reference.matrix), "vector": _floats(reference.vector)},
        "components": {"shape": list(reference.components.shape), "numbers": _floats(reference.components)},
        "cycles varied": variation.cycles,
        "scale": _floats(variation.scale),
        "moments": _floats(variation.moments),
        "prediction errors": {"sum": reference.spe_sum.hex(), "count": reference.spe_count},
    }


def _model_gap(durable: StoredState) -> dict[str, Any]:
    gap = durable.cell.gap
    return {
        "count": gap.count,
        "mean": gap.mean.hex(),
        "squares": gap.squared_deviations.hex(),
        "excess": gap.excess.hex(),
        "since": gap.since,
    }


def without_later_conditions(found: dict[str, Any], expected: dict[str, Any]) -> dict[str, Any]:
    """Leave out conditions that there were none of at the time: they begin normal."""
    conditions, then = found["alarms"]["conditions"], expected["alarms"]["conditions"]
    for name in conditions.keys() - then.keys():
        later = conditions.pop(name)
        assert not later["active"]
        assert later["acknowledged"]
        assert later["confirmed"]
        found["last snapshot"]["alarms"].remove(name)
    return found


def _alarms(durable: StoredState) -> dict[str, Any]:
    book = durable.cell.alarms
    counters = dict(zip((alarm.name for alarm in book.alarms), book.counters, strict=True))
    conditions = {
        alarm.name: {
            **_alarm(alarm),
            "cycles the rule held, missed, called": [
                counters[alarm.name].held,
                counters[alarm.name].missed,
                counters[alarm.name].called,
            ],
        }
        for alarm in book.alarms
    }
    return {
        "conditions": conditions,
        "cycles for which a batch change stays announced": book.suppressed_cycles,
    }


def _alarm(alarm: Alarm) -> dict[str, Any]:
    evidence = alarm.evidence
    return {
        "condition": alarm.name,
        "enabled": alarm.enabled,
        "active": alarm.active,
        "acknowledged": alarm.acknowledged,
        "confirmed": alarm.confirmed,
        "shelving": alarm.shelving.value,
        "shelved until": alarm.shelved_until_ns,
        "suppressed": alarm.suppressed,
        "out of service": alarm.out_of_service,
        "severity": alarm.severity,
        "message": alarm.message,
        "cycle": alarm.cycle,
        "time_ns": alarm.time_ns,
        "comment": alarm.comment,
        "user": alarm.user,
        "evidence": {
            "statistic": evidence.statistic.hex(),
            "threshold": evidence.threshold.hex(),
            "change_cycle": evidence.change_cycle,
            "size": evidence.size.hex(),
            "size_std": evidence.size_std.hex(),
            "false_alarm_cycles": evidence.false_alarm_cycles.hex(),
            "false_alarm_days": evidence.false_alarm_days.hex(),
        },
    }


def _planner(durable: StoredState) -> dict[str, Any]:
    assert durable.planner is not None
    belief = parts_of(durable.planner)[0]
    return {
        "weights": _floats(belief.weights),
        "means": _of_parameters(belief.means[:, :PARAMETERS]),
        "covariances": _of_parameters(belief.covs[:, :PARAMETERS, :PARAMETERS]),
        "scatter of friction": round(belief.scatter, 2),
        "taps": belief.taps,
        "surprise": belief.surprise.hex(),
    }


def _of_parameters(values: np.ndarray) -> dict[str, Any]:
    return {"shape": list(values.shape), "numbers": _floats(values)}


def _snapshot(durable: StoredState) -> dict[str, Any]:
    snapshot = durable.snapshot
    assert snapshot is not None
    friction, wear, batch = snapshot.friction, snapshot.wear, snapshot.batch
    task, signature = snapshot.positioning, snapshot.signature
    return {
        "cycle": snapshot.cycle,
        "time_ns": snapshot.time_ns,
        "velocity and mass": _floats([snapshot.velocity_m_s, snapshot.mass_kg]),
        "friction": {
            name: {**_number(value.value, value.std), "quality": value.quality.name, "reason": value.reason}
            for name, value in (
                ("mu_s", friction.mu_s),
                ("mu_k", friction.mu_k),
                ("by force", friction.by_force),
                ("by distance", friction.by_distance),
                ("combined", friction.combined),
            )
        },
        "estimator": friction.estimator.value,
        "peak force and sliding distance": _floats([friction.peak_force_n, friction.sliding_distance_m]),
        "wear": {
            "level": _number(wear.level, wear.level_std),
            "rate per cycle": _number(wear.rate_per_cycle, wear.rate_std),
            "limit": wear.limit.hex(),
            "probability above it": wear.probability_above_limit.hex(),
            "cycles to it": _floats(
                [wear.cycles_to_limit, wear.cycles_to_limit_low, wear.cycles_to_limit_high]
            ),
            "quality": wear.quality.name,
            "reason": wear.reason,
        },
        "batch": {
            "id": batch.batch_id,
            "offset": _number(batch.offset, batch.offset_std),
            "last shift": _number(batch.last_shift, batch.last_shift_std),
            "last shift's cycle": batch.last_shift_cycle,
            "quality": batch.quality.name,
            "reason": batch.reason,
        },
        "signature": {
            "position_m": _floats(signature.position_m),
            "friction": _floats(signature.friction),
            "std": _floats(signature.friction_std),
            "statistics": _floats([signature.t_squared, signature.spe, signature.deviates_at_m]),
            "quality": signature.quality.name,
            "reason": signature.reason,
        },
        "positioning": {
            "target, remaining, velocity, stroke": _floats(
                [task.target_m, task.remaining_m, task.next_velocity_m_s, task.next_stroke_m]
            ),
            "running": task.running,
            "taps": task.taps,
            "reason": task.reason,
        },
        "alarms": [alarm.name for alarm in snapshot.alarms],
        "model": snapshot.model_name,
        "gap": {"size": snapshot.gap.hex(), "quality": snapshot.gap_quality.name},
    }


def _number(value: float, std: float) -> dict[str, str]:
    return {"value": value.hex(), "std": std.hex()}


def _floats(values: Iterable[Any]) -> list[str]:
    return [float(value).hex() for value in np.ravel(values)]  # type: ignore[call-overload]
