"""What the page remembers of one cell, and what it sends of it as JSON, in the units of the nodes."""

import json
import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from impactcell.quantities import BY_PATH
from impactcell.records import Alarm, Channel, Coefficient, ModuleStatus, Samples, Snapshot
from impactcell.scada.alarm_events import event_id
from impactcell.web.curves import Curve, decimate, envelope
from impactcell.web.interface import CellNews, Freshness

RECENT_CYCLES = 120
"""Cycles of the small curve on a card."""
USUAL_TAPS = 20
"""Earlier taps that say what is usual."""
SAME_VELOCITY = 0.01
"""Taps whose commanded velocities differ by less than this share are compared with each other."""
SHOWN_TAPS = 12
"""Taps of a positioning task that are listed."""
DIGITS = 5
"""Significant digits of what is sent: more than a chart can show."""


@dataclass(frozen=True, slots=True, eq=False)
class _Tap:
    """One tap in curves, to compare later ones with."""

    velocity_m_s: float
    force: Curve | None
    position: Curve | None
    signature: Curve


def to_json(value: object) -> bytes:
    """Encode for the browser; there is no NaN in what is sent."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()


def number(value: float) -> float | None:
    """Shorten a number; None where it is not finite."""
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


def numbers(values: Samples, per_si: float = 1.0) -> list[float | None]:
    """Shorten a series of numbers."""
    return [number(value) for value in (values * per_si).tolist()]


class CellView:
    """One cell as the page shows it."""

    def __init__(self, cell: str) -> None:
        self.cell = cell
        self.snapshot: Snapshot | None = None
        self.status = ModuleStatus()
        self.freshness = Freshness.LOST
        self.alarms: dict[str, Alarm] = {}
        self._alarm_json: dict[str, tuple[Alarm, dict[str, Any]]] = {}
        self._recent: deque[list[float | None]] = deque(maxlen=RECENT_CYCLES)
        self._taps: deque[_Tap] = deque(maxlen=USUAL_TAPS + 1)
        self._positioning: deque[dict[str, Any]] = deque(maxlen=SHOWN_TAPS)
        self._deviant: dict[str, Any] | None = None

    def take(self, news: CellNews) -> None:
        """Take what has happened."""
        if news.status is not None:
            self.status = news.status
        if news.freshness is not None:
            self.freshness = news.freshness
        alarms = news.alarms
        if news.snapshot is not None:
            self._take_snapshot(news.snapshot)
            alarms = news.snapshot.alarms
        if news.capture is not None and news.snapshot is not None:
            self._take_tap(news.snapshot, news.capture.force, news.capture.position)
        for alarm in alarms:
            self.alarms[alarm.name] = alarm

    def _take_snapshot(self, snapshot: Snapshot) -> None:
        previous, self.snapshot = self.snapshot, snapshot
        if previous is not None and previous.cycle == snapshot.cycle:
            return
        mu_s, wear = snapshot.friction.mu_s, snapshot.wear
        self._recent.append([snapshot.cycle, number(mu_s.value), number(wear.level)])
        self._take_positioning(snapshot)

    def _take_positioning(self, snapshot: Snapshot) -> None:
        task = snapshot.positioning
        if not math.isfinite(task.target_m):
            return
        target_mm = number(task.target_m * 1e3)
        if self._positioning and self._positioning[-1]["target"] != target_mm:
            self._positioning.clear()
        velocity = BY_PATH["Friction/ActuationVelocity"].read(snapshot)[0]
        self._positioning.append(
            {
                "cycle": snapshot.cycle,
                "target": target_mm,
                "velocity": number(float(velocity)),  # type: ignore[arg-type]
                "remaining": number(task.remaining_m * 1e3),
            }
        )

    def _take_tap(self, snapshot: Snapshot, force: Channel | None, position: Channel | None) -> None:
        signature = snapshot.signature
        if math.isfinite(signature.deviates_at_m):
            self._deviant = {
                "cycle": snapshot.cycle,
                "at": number(signature.deviates_at_m * 1e3),
                "friction": numbers(signature.friction),
            }
        self._taps.append(
            _Tap(
                snapshot.velocity_m_s,
                None if force is None or not len(force.values) else decimate(force),
                None if position is None or not len(position.values) else decimate(position),
                Curve(signature.position_m, signature.friction, signature.friction),
            )
        )

    def card(self) -> bytes:
        """Encode what a card shows."""
        content: dict[str, Any] = {
            "cell": self.cell,
            "freshness": self.freshness.value,
            "link": _link(self.status),
            "alarms": [self._alarm(alarm) for alarm in self.alarms.values()],
            "recent": list(self._recent),
        }
        if self.snapshot is not None:
            content |= _cycle(self.snapshot)
        return to_json(content)

    def detail(self) -> bytes:
        """Encode what the cell's own page shows beside the card: the last tap against the usual ones."""
        content: dict[str, Any] = {
            "cell": self.cell,
            "taps": list(self._positioning),
            "deviant": self._deviant,
        }
        if self._taps and self.snapshot is not None:
            tap, earlier = self._taps[-1], list(self._taps)[:-1]
            alike = [
                t for t in earlier if math.isclose(t.velocity_m_s, tap.velocity_m_s, rel_tol=SAME_VELOCITY)
            ]
            content["usual_taps"] = len(alike)
            content["force"] = _compared(tap.force, (t.force for t in alike), 1e3, 1.0)
            content["position"] = _compared(tap.position, (t.position for t in alike), 1e3, 1e3)
            content["signature"] = _compared(tap.signature, (t.signature for t in alike), 1e3, 1.0)
            content["signature"]["std"] = numbers(self.snapshot.signature.friction_std)
        return to_json(content)

    def _alarm(self, alarm: Alarm) -> dict[str, Any]:
        """Encode an alarm; from cycle to cycle it is the same record nearly always."""
        last = self._alarm_json.get(alarm.name)
        if last is None or last[0] is not alarm:
            last = alarm, alarm_content(self.cell, alarm)
            self._alarm_json[alarm.name] = last
        return last[1]


def _compared(
    curve: Curve | None, usual: Iterable[Curve | None], x_per_si: float, per_si: float
) -> dict[str, Any]:
    if curve is None:
        return {}
    band = envelope([c for c in usual if c is not None], curve.x)
    content: dict[str, Any] = {
        "x": numbers(curve.x, x_per_si),
        "low": numbers(curve.low, per_si),
        "high": numbers(curve.high, per_si),
    }
    if band is not None:
        content |= {"usual_low": numbers(band.low, per_si), "usual_high": numbers(band.high, per_si)}
    return content


def alarm_content(cell: str, alarm: Alarm) -> dict[str, Any]:
    """Give an alarm with its reason and evidence, as the browser gets it."""
    evidence = alarm.evidence
    return {
        "name": alarm.name,
        "active": alarm.active,
        "acknowledged": alarm.acknowledged,
        "confirmed": alarm.confirmed,
        "enabled": alarm.enabled,
        "shelved": alarm.shelving.value,
        "severity": alarm.severity,
        "message": {"en": alarm.message, "de": alarm.message_de},
        "cycle": alarm.cycle,
        "time_ms": alarm.time_ns // 1_000_000,
        "comment": alarm.comment,
        "user": alarm.user,
        "event_id": event_id(cell, alarm).hex(),
        "evidence": {
            "statistic": number(evidence.statistic),
            "threshold": number(evidence.threshold),
            "change_cycle": evidence.change_cycle or None,
            "size": number(evidence.size),
            "size_std": number(evidence.size_std),
            "false_alarm_cycles": number(evidence.false_alarm_cycles),
        },
    }


def _link(status: ModuleStatus) -> dict[str, Any]:
    return {
        "connected": status.connected,
        "reason": "" if status.connected else status.reason,
        "round_trip_ms": number(status.round_trip_s * 1e3),
        "received": status.received,
        "missed": status.missed,
        "unreadable": status.unreadable,
        "discarded": status.discarded,
        "restarts": status.restarts,
        "reconnects": status.reconnects,
    }


def _coefficient(coefficient: Coefficient) -> dict[str, Any]:
    return {
        "value": number(coefficient.value),
        "std": number(coefficient.std),
        "quality": coefficient.quality.name.lower(),
        "reason": coefficient.reason,
    }


def _cycle(snapshot: Snapshot) -> dict[str, Any]:
    friction, wear, batch, task = snapshot.friction, snapshot.wear, snapshot.batch, snapshot.positioning
    signature = snapshot.signature
    return {
        "cycle": snapshot.cycle,
        "time_ms": snapshot.time_ns // 1_000_000,
        "velocity": number(snapshot.velocity_m_s * 60e3),
        "mass": number(snapshot.mass_kg),
        "mu_s": _coefficient(friction.mu_s),
        "mu_k": _coefficient(friction.mu_k),
        "by_force": _coefficient(friction.by_force),
        "by_distance": _coefficient(friction.by_distance),
        "estimator": friction.estimator.value,
        "peak_force": number(friction.peak_force_n),
        "sliding_distance": number(friction.sliding_distance_m * 1e6),
        "wear": {
            "level": number(wear.level),
            "std": number(wear.level_std),
            "rate_per_1000": number(wear.rate_per_cycle * 1e3),
            "limit": number(wear.limit),
            "cycles": number(wear.cycles_to_limit),
            "cycles_low": number(wear.cycles_to_limit_low),
            "cycles_high": number(wear.cycles_to_limit_high),
            "quality": wear.quality.name.lower(),
            "reason": wear.reason,
        },
        "batch": {
            "id": batch.batch_id,
            "offset": number(batch.offset),
            "std": number(batch.offset_std),
            "last_shift": number(batch.last_shift),
            "last_shift_cycle": batch.last_shift_cycle or None,
            "quality": batch.quality.name.lower(),
        },
        "signature_test": {
            "t_squared": number(signature.t_squared),
            "spe": number(signature.spe),
            "deviates_at": number(signature.deviates_at_m * 1e3),
            "quality": signature.quality.name.lower(),
            "reason": signature.reason,
        },
        "positioning": {
            "running": task.running,
            "taps": task.taps,
            "target": number(task.target_m * 1e3),
            "remaining": number(task.remaining_m * 1e3),
            "next_velocity": number(task.next_velocity_m_s * 60e3),
            "next_stroke": number(task.next_stroke_m * 1e3),
            "reason": task.reason,
        },
        "model": snapshot.model_name,
        "gap": number(snapshot.gap),
        "gap_quality": snapshot.gap_quality.name.lower(),
    }
