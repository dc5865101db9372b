"""Forces on the part and motion of the actuator within one smooth phase.

Every law is evaluated by its smooth continuation: what is switched on is said by the contact mode, never by
the sign of the state, so that a step that runs past an event is still a step of a smooth equation.
"""

from impactcell.numerics.jit import FloatPointer, compiled, inlined, invoke
from impactcell.physics import memory_layout as at
from impactcell.physics.memory_layout import SmoothPhase


@inlined
def evaluate_law(place: int, a: float, b: float, c: float, d: float, phase: SmoothPhase) -> float:
    """Value of the law listed at this place of `laws` for its four numbers, as `LawKind` has them."""
    return invoke(phase.laws[place], a, b, c, d, phase.parameters, phase.laws[place + 1])


@inlined
def actuator_speed(t: float, state: FloatPointer, phase: SmoothPhase) -> float:
    """Y' = v times the laws of its run-up, less the speed the laws of its load take away [m/s]."""
    if phase.contact_mode[at.RUNNING] == 0:
        return 0.0
    speed = phase.parameters[at.VELOCITY]
    for i in range(phase.laws[at.SPEED], phase.laws[at.SPEED + 1], 2):
        speed *= evaluate_law(i, t, 0.0, 0.0, 0.0, phase)
    for i in range(at.FIRST_EXTRA_STATE, phase.contact_mode[at.STATE_COUNT]):
        speed -= state[i]
    return speed


@inlined
def compression(state: FloatPointer, speed: float, phase: SmoothPhase) -> float:
    """Contact force while touching, before it is clipped at zero [N]."""
    d = state[at.TRAVEL] - state[at.ADVANCE]
    rate = speed - state[at.PART_SPEED]
    force = phase.parameters[at.STIFFNESS] * d
    if phase.contact_mode[at.DAMPER] == 1:
        force += phase.parameters[at.DAMPING] * rate
    for i in range(phase.laws[at.CONTACT], phase.laws[at.CONTACT + 1], 2):
        force += evaluate_law(i, d, rate, phase.parameters[at.STIFFNESS], phase.parameters[at.DAMPING], phase)
    return force


@inlined
def contact_force(state: FloatPointer, speed: float, phase: SmoothPhase) -> float:
    """Force of the actuator on the part, positive in compression, negative in adhesion [N]."""
    if phase.contact_mode[at.ZONE] == at.TOUCHING:
        return 0.0 if phase.contact_mode[at.CLIPPED] == 1 else compression(state, speed, phase)
    force = 0.0
    if phase.contact_mode[at.ZONE] == at.NEAR:
        for i in range(phase.laws[at.PULL], phase.laws[at.PULL + 1], 2):
            force -= evaluate_law(i, state[at.ADVANCE] - state[at.TRAVEL], 0.0, 0.0, 0.0, phase)
    return force


@inlined
def body_force(t: float, state: FloatPointer, phase: SmoothPhase) -> float:
    """Sum up the forces on the part other than contact and Coulomb friction, along the tap [N]."""
    direction = phase.parameters[at.DIRECTION]
    force = phase.cache[at.DRIVE] + phase.cache[at.DRIVE_SLOPE] * (t - phase.cache[at.DRIVE_TIME])
    if phase.laws[at.BODY + 1] > phase.laws[at.BODY]:
        x = phase.parameters[at.START] + direction * state[at.ADVANCE]
        velocity = direction * state[at.PART_SPEED]
        for i in range(phase.laws[at.BODY], phase.laws[at.BODY + 1], 2):
            force += evaluate_law(
                i, x, velocity, phase.parameters[at.MASS], phase.parameters[at.GRAVITY], phase
            )
    return direction * force


@inlined
def friction_scale(advance: float, phase: SmoothPhase) -> float:
    """Product of the laws by which friction varies along the table [1]."""
    scale = 1.0
    x = phase.parameters[at.START] + phase.parameters[at.DIRECTION] * advance
    for i in range(phase.laws[at.SCALE], phase.laws[at.SCALE + 1], 2):
        scale *= evaluate_law(i, x, 0.0, 0.0, 0.0, phase)
    return scale


@inlined
def kinetic_friction(advance: float, speed: float, phase: SmoothPhase) -> float:
    """Magnitude of Coulomb friction in slip at `speed` >= 0 [N]."""
    mu = phase.parameters[at.MU_K]
    for i in range(phase.laws[at.KINETIC], phase.laws[at.KINETIC + 1], 2):
        x = phase.parameters[at.START] + phase.parameters[at.DIRECTION] * advance
        mu += evaluate_law(i, speed, x, 0.0, 0.0, phase)
    return mu * friction_scale(advance, phase) * phase.parameters[at.MASS] * phase.parameters[at.GRAVITY]


@compiled
def breakaway_force(advance: float, phase: SmoothPhase) -> float:
    """Force that stick can hold [N].

    mu_s m g; where the friction of slow slip is larger than that, the part only moves once it is exceeded.
    """
    parameters = phase.parameters
    static = (
        parameters[at.MU_S] * friction_scale(advance, phase) * parameters[at.MASS] * parameters[at.GRAVITY]
    )
    return max(static, kinetic_friction(advance, 0.0, phase))


@inlined
def derivative(t: float, state: FloatPointer, phase: SmoothPhase, out: FloatPointer, begin: int) -> None:
    """Equations of motion (1)-(3) of the present phase, into `out` from index `begin` on."""
    speed = actuator_speed(t, state, phase)
    slip = phase.contact_mode[at.SLIP]
    force = 0.0
    if phase.contact_mode[at.ZONE] >= at.NEAR:
        force = contact_force(state, speed, phase)
    if slip == 0:
        out[begin + at.ADVANCE] = 0.0
        out[begin + at.PART_SPEED] = 0.0
    else:
        total = force + body_force(t, state, phase)
        if slip == at.ELASTIC:
            total -= phase.cache[at.STICK_STIFFNESS] * (state[at.ADVANCE] - phase.cache[at.ANCHOR])
        else:
            total -= slip * kinetic_friction(state[at.ADVANCE], slip * state[at.PART_SPEED], phase)
        out[begin + at.ADVANCE] = state[at.PART_SPEED]
        out[begin + at.PART_SPEED] = total / phase.parameters[at.MASS]
    out[begin + at.TRAVEL] = speed
    for i in range(at.FIRST_EXTRA_STATE, phase.contact_mode[at.STATE_COUNT]):
        law = phase.laws[at.LOSS] + 2 * (i - at.FIRST_EXTRA_STATE)
        lost = 0.0
        if phase.contact_mode[at.RUNNING] == 1:
            lost = evaluate_law(law, state[i], force, 0.0, 0.0, phase)
        out[begin + i] = lost


@compiled
def sensor_reading(force: float, phase: SmoothPhase) -> float:
    """Apply the sensor's laws to a contact force that has been through its lag [N]."""
    for i in range(phase.laws[at.READING], phase.laws[at.READING + 1], 2):
        force = evaluate_law(i, force, 0.0, 0.0, 0.0, phase)
    return force
