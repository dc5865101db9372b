"""One tap integrated from event to event: equations (1)-(3)."""

import math

import numpy as np
from scipy.integrate import solve_ivp

from impactcell.errors import NoStopError, PhysicsError
from impactcell.physics.motion import Event, EventKind, Motion, Sampled
from impactcell.physics.plant import Plant, Strike
from impactcell.records import Samples


def strike(plant: Plant, tap: Strike) -> Motion:
    """Integrate one tap; nominal plant with viscous friction for now."""
    unknown = set(plant.effects) - {"viscous_friction"}
    if unknown:
        raise PhysicsError(f"effects not available yet: {sorted(unknown)}")
    k, b, m = plant.stiffness_n_per_m, plant.damping_n_s_per_m, tap.mass_kg
    kv = plant.effects.get("viscous_friction", {}).get("viscous_coefficient_n_s_per_m", 0.0)
    fs, fk = plant.mu_s * m * plant.gravity_m_s2, plant.mu_k * m * plant.gravity_m_s2
    events: list[Event] = []
    pieces: list[tuple[float, object]] = []
    t, x, w, halt = 0.0, 0.0, 0.0, tap.stroke_m / tap.velocity_m_s
    contact, moving = True, False
    x_sep = math.nan
    halted_at = math.inf

    def y(time: float) -> float:
        return tap.velocity_m_s * min(time, halted_at)

    def force(time: float, pos: float, vel: float, *, touch: bool) -> float:
        if not touch:
            return 0.0
        rate = (tap.velocity_m_s if time < halted_at else 0.0) - vel
        return k * max(y(time) - pos, 0.0) + b * max(rate, 0.0)

    for _ in range(1000):
        if halted_at == math.inf and t >= halt:
            halted_at = halt
            events.append(Event(EventKind.HALT, t))
        running = t < halted_at
        if not moving:
            f = force(t, x, 0.0, touch=contact)
            if f >= fs and f > 0.0:
                moving = True
                events.append(Event(EventKind.BREAKAWAY, t))
                continue
            if not running:
                break
            v = tap.velocity_m_s
            next_t = (fs - b * v) / (k * v) + x / v if contact else x / v
            next_t = max(next_t, t)
            end = min(next_t, halt)
            pieces.append((t, (x, contact)))
            t = end
            if next_t <= halt:
                if contact:
                    moving = True
                    events.append(Event(EventKind.BREAKAWAY, t))
                else:
                    contact = True
                    events.append(Event(EventKind.CONTACT, t))
            continue
        touch = contact
        v = tap.velocity_m_s if running else 0.0

        def rhs(time: float, s: Samples, *, touch: bool = touch, v: float = v) -> list[float]:
            f = (k * (y(time) - s[0]) + b * max(v - s[1], 0.0)) if touch else 0.0
            return [s[1], (f - fk * math.copysign(1.0, s[1] if s[1] != 0 else 1.0) - kv * s[1]) / m]

        def gap(time: float, s: Samples) -> float:
            return y(time) - s[0]

        def rest(_time: float, s: Samples) -> float:
            return float(s[1])

        gap.terminal = rest.terminal = True  # type: ignore[attr-defined]
        gap.direction = -1.0 if touch else 1.0  # type: ignore[attr-defined]
        rest.direction = -1.0  # type: ignore[attr-defined]
        end = min(halt, t + 5.0) if running else t + 5.0
        step = solve_ivp(
            rhs, (t, end), [x, w], "DOP853", events=[gap, rest], rtol=1e-11, atol=1e-14, dense_output=True
        )
        pieces.append((t, (step.sol, touch)))
        t, x, w = float(step.t[-1]), float(step.y[0, -1]), float(step.y[1, -1])
        if step.status == 1:
            if len(step.t_events[0]):
                contact = not touch
                x = y(t) + (-1e-13 if contact else 1e-13)
                events.append(Event(EventKind.CONTACT if contact else EventKind.SEPARATION, t))
                if not contact:
                    x_sep = x
                    if tap.halts_at_separation and halted_at == math.inf:
                        halt = t
            else:
                moving, w = False, 0.0
                events.append(Event(EventKind.STOP, t))
        elif not running or t > 60.0:
            raise NoStopError("the part was still moving after 5 s without an event")
    else:
        raise NoStopError("the part was still caught and pushed after 1000 events; command a stroke")
    stop, rest_x, rest_contact = t if w or x else 0.0, x, contact
    starts = np.array([p[0] for p in pieces])

    def course(times: Samples) -> Sampled:
        out = np.zeros((4, len(times)))
        for i, time in enumerate(times):
            j = int(np.searchsorted(starts, time, "right")) - 1
            if time <= 0.0:
                continue
            body, touch = (rest_x, rest_contact) if time >= t else pieces[j][1]  # type: ignore[misc]
            pos, vel = (body, 0.0) if isinstance(body, float) else body(time)  # type: ignore[has-type]
            out[:, i] = force(time, pos, vel, touch=touch), pos, y(time), vel  # type: ignore[has-type]
        sign = tap.direction
        return Sampled(out[0], tap.start_m + sign * out[1], tap.start_m + sign * out[2], sign * out[3])

    last = [e.time_s for e in events if e.kind is EventKind.STOP]
    stop = last[-1] if last else 0.0
    motion = Motion(tuple(events), 0.0, x, stop, x - x_sep, course)
    grid = np.unique(
        np.concatenate(
            [
                np.linspace(0.0, max(t, 1e-6), 2001),
                np.array([e.time_s * (1 + s) for e in events for s in (-1e-12, 1e-12)]),
            ]
        )
    )
    peak = float(course(grid[grid > 0]).force_n.max())
    return Motion(motion.events, peak, x, stop, x - x_sep, course)
