"""What the page remembers of one cell, and what it sends of it as JSON, in the units of the nodes."""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import msgspec
import numpy as np

from impactcell.alarms import is_retained
from impactcell.german.positioning_reasons import german_positioning_reason
from impactcell.quantities import BY_PATH, CYCLE, MODULE
from impactcell.records import Alarm, Capture, ModuleStatus, Quality, Samples, Shelving, Snapshot
from impactcell.records.quantity import Quantity, S
from impactcell.scada.alarm_events import event_id
from impactcell.web.curves import Curve, decimate, envelope
from impactcell.web.interface import CellNews, Freshness
from impactcell.web.messages import Messages
from impactcell.web.texts import LANGUAGES
from impactcell.web.texts.reasons import english_reason, german_reason

RECENT_CYCLES = 120
"""Cycles of the small curve on a card."""
USUAL_TAPS = 20
"""Earlier taps that say what is usual."""
ALIKE = 0.01
"""Taps whose velocity, stroke and mass differ by less than this share are compared with each other."""
SHOWN_TAPS = 12
"""Taps of a positioning task that are listed."""
DIGITS = 5
"""Significant digits of what is sent: more than a chart can show."""


KINDS: Final = ("recent", "alarms", "card", "detail")
"""What is sent of a cell: the curve so far, its alarms, its values, and its last tap in curves."""


@dataclass(frozen=True, slots=True, eq=False)
class _Tap:
    """One tap in curves, to compare later ones with."""

    struck: tuple[float, float, float, int]
    """Velocity (m/s), stroke (m), mass (kg) and direction."""
    force: Curve | None
    position: Curve | None
    signature: Curve
    is_deviant: bool

    def is_alike(self, other: "_Tap") -> bool:
        """Whether the other was struck alike; what is known of neither does not tell them apart."""
        pairs = zip(self.struck, other.struck, strict=True)
        return all(math.isclose(a, b, rel_tol=ALIKE) or (math.isnan(a) and math.isnan(b)) for a, b in pairs)


_INFINITE: Final = msgspec.Raw(b"1e999")
"""JSON has no infinity, but a number that every reader takes for one."""


def to_json(value: object) -> bytes:
    """Encode for the browser; what is not finite becomes null."""
    return msgspec.json.encode(value)


def number(value: float) -> float | None:
    """Shorten a number; None where it is not finite."""
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


def numbers(values: Samples, per_si: float = 1.0) -> list[float]:
    """Shorten numbers to so many digits of the largest; what is not finite becomes null when it is sent."""
    shown = values * per_si
    largest = float(np.max(np.abs(shown), initial=0.0, where=np.isfinite(shown)))
    decimals = DIGITS - 1 - math.floor(math.log10(largest)) if largest > 0.0 else 0
    rounded: list[float] = np.round(shown, decimals).tolist()
    return rounded


class CellView:
    """One cell as the page shows it."""

    def __init__(self, cell: str) -> None:
        self.cell = cell
        self.snapshot: Snapshot | None = None
        self.status = ModuleStatus()
        self.freshness = Freshness.LOST
        self.conditions: dict[str, Alarm] = {}
        self._recent: deque[list[float | None]] = deque(maxlen=RECENT_CYCLES)
        self._taps: deque[_Tap] = deque(maxlen=USUAL_TAPS + 1)
        self._positioning: deque[dict[str, Any]] = deque(maxlen=SHOWN_TAPS)
        self._deviant: dict[str, Any] | None = None

    def take(self, news: CellNews) -> set[str]:
        """Take what has happened; returns which of `KINDS` have changed by it."""
        changed = set()
        if news.status is not None and news.status != self.status:
            self.status = news.status
            changed.add("card")
        if news.freshness is not None and news.freshness is not self.freshness:
            self.freshness = news.freshness
            changed.add("card")
        alarms = news.alarms
        if news.snapshot is not None:
            self._take_snapshot(news.snapshot)
            alarms = news.snapshot.alarms
            changed |= {"card", "detail"}
        if news.capture is not None and news.snapshot is not None:
            self._take_tap(news.snapshot, news.capture)
        for alarm in alarms:
            if self.conditions.get(alarm.name) is not alarm:
                self.conditions[alarm.name] = alarm
                changed.add("alarms")
        return changed

    def encode(self, kind: str) -> bytes:
        """Encode what is sent of one of `KINDS`."""
        return to_json({"cell": self.cell} | getattr(self, kind)())

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

    def _take_tap(self, snapshot: Snapshot, capture: Capture) -> None:
        signature, force, position = snapshot.signature, capture.force, capture.position
        if math.isfinite(signature.deviates_at_m):
            self._deviant = {
                "cycle": snapshot.cycle,
                "at": number(signature.deviates_at_m * 1e3),
                "friction": numbers(signature.friction),
            }
        self._taps.append(
            _Tap(
                (snapshot.velocity_m_s, capture.stroke_m, snapshot.mass_kg, capture.direction),
                None if force is None or not len(force.values) else decimate(force),
                None if position is None or not len(position.values) else decimate(position),
                Curve(signature.position_m, signature.friction, signature.friction),
                math.isfinite(signature.deviates_at_m),
            )
        )

    def recent(self) -> dict[str, Any]:
        """Give the small curve as it is when somebody comes; from then on a card brings each new point."""
        return {"recent": list(self._recent)}

    def alarms(self) -> dict[str, Any]:
        """Give every alarm; they are sent when one of them has moved."""
        return {"alarms": [alarm_content(self.cell, alarm) for alarm in self.conditions.values()]}

    def card(self) -> dict[str, Any]:
        """Give what a card shows: every published value, and why some are not good."""
        content: dict[str, Any] = {
            "freshness": self.freshness.value,
            "link_reason": {
                language: Messages(language).link_fault("" if self.status.connected else self.status.reason)
                for language in LANGUAGES
            },
        }
        values, qualities = _published(MODULE, self.status)
        if self.snapshot is not None:
            of_cycle = _published(CYCLE, self.snapshot)
            values, qualities = values | of_cycle[0], qualities | of_cycle[1]
            content |= _beside_values(self.snapshot)
        return content | {"values": values, "qualities": qualities}

    def detail(self) -> dict[str, Any]:
        """Give what the cell's own page shows beside the card: the last tap against the usual ones."""
        content: dict[str, Any] = {"taps": list(self._positioning), "deviant": self._deviant}
        if self._taps and self.snapshot is not None:
            tap, earlier = self._taps[-1], list(self._taps)[:-1]
            alike = [t for t in earlier if not t.is_deviant and t.is_alike(tap)]  # a deviant one is not usual
            content["usual_taps"] = len(alike)
            content["force"] = _compared(tap.force, (t.force for t in alike), 1e3, 1.0)
            content["position"] = _compared(tap.position, (t.position for t in alike), 1e3, 1e3)
            content["signature"] = _compared(tap.signature, (t.signature for t in alike), 1e3, 1.0)
            content["signature"]["std"] = numbers(self.snapshot.signature.friction_std)
        return content


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


def is_listed(alarm: Alarm) -> bool:
    """Whether the page lists an alarm among those that are open."""
    return is_retained(alarm) or alarm.shelving is not Shelving.UNSHELVED


def alarm_content(cell: str, alarm: Alarm) -> dict[str, Any]:
    """Give an alarm with its reason and evidence, as the browser gets it."""
    evidence = alarm.evidence
    return {
        "name": alarm.name,
        "active": alarm.active,
        "acknowledged": alarm.acknowledged,
        "confirmed": alarm.confirmed,
        "enabled": alarm.enabled,
        "listed": is_listed(alarm),
        "shelved": alarm.shelving.value,
        "severity": alarm.severity,
        "message": {"en": alarm.message, "de": alarm.message_de},
        "cycle": alarm.cycle,
        "time_ms": alarm.time_ns // 1_000_000,
        "comment": alarm.comment,
        "comment_user": alarm.comment_user,
        "user": alarm.user,
        "event_id": event_id(cell, alarm).hex(),
        "evidence": {
            "compared": {language: Messages(language).compared(alarm) for language in LANGUAGES},
            "change_cycle": evidence.change_cycle or None,
            "size": number(evidence.told_size),
            "size_std": number(evidence.size_std),
            "false_alarm_cycles": number(evidence.false_alarm_cycles),
        },
    }


def _published(quantities: Iterable[Quantity[S]], source: S) -> tuple[dict[str, Any], dict[str, str]]:
    """Read every published value but the arrays, which are curves; and the qualities that are not good.

    What is not known becomes null, what is infinite does not: a limit that is never reached.
    """
    values: dict[str, Any] = {}
    qualities: dict[str, str] = {}
    for quantity in quantities:
        if quantity.is_array:
            continue
        value, quality = quantity.read(source)
        if isinstance(value, float):
            values[quantity.path] = _INFINITE if value == math.inf else number(value)
        else:
            values[quantity.path] = value
        if quality is not Quality.GOOD:
            qualities[quantity.path] = quality.name.lower()
    return values, qualities


def _beside_values(snapshot: Snapshot) -> dict[str, Any]:
    """Give what is said of a cycle beside its published values."""
    positioning = snapshot.positioning.reason
    reasons = {
        "mu_s": snapshot.friction.mu_s.reason,
        "wear": snapshot.wear.reason,
        "batch": snapshot.batch.reason,
        "signature": snapshot.signature.reason,
    }
    return {
        "time_ms": snapshot.time_ns // 1_000_000,
        "mass": number(snapshot.mass_kg),
        "estimator": snapshot.friction.estimator.value,
        "model": {language: Messages(language).model(snapshot.model_name) for language in LANGUAGES},
        "reasons": {
            "en": {name: english_reason(text) for name, text in reasons.items()}
            | {"positioning": positioning},
            "de": {name: german_reason(text) for name, text in reasons.items()}
            | {"positioning": german_positioning_reason(positioning)},
        },
    }
