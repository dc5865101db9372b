"""Forces on the part and motion of the actuator within one smooth phase.

Every law is evaluated by its smooth continuation: what is switched on is said by `mode`, never by the sign
of the state, so that a step that runs past an event is still a step of a smooth equation. All arrays are
bare pointers (`impactcell.numerics.jit.pointer`) laid out as in `impactcell.physics.memory_layout`.
"""

from impactcell.numerics.jit import FloatPointer, IntPointer, compiled, invoke
from impactcell.physics import memory_layout as at


@compiled
def actuator_speed(
    t: float, z: FloatPointer, mode: IntPointer, row: FloatPointer, program: IntPointer
) -> float:
    """Y' = v times the laws of its run-up, less the speed the laws of its load take away [m/s]."""
    if mode[at.RUNNING] == 0:
        return 0.0
    speed = row[at.VELOCITY]
    for i in range(program[at.SPEED], program[at.SPEED + 1], 2):
        speed *= invoke(program[i], t, 0.0, 0.0, 0.0, row, program[i + 1])
    for i in range(at.EXTRA, mode[at.STATES]):
        speed -= z[i]
    return speed


@compiled
def compression(
    z: FloatPointer, speed: float, mode: IntPointer, row: FloatPointer, program: IntPointer
) -> float:
    """Contact force while touching, before it is clipped at zero [N]."""
    d = z[at.TRAVEL] - z[at.U]
    rate = speed - z[at.SPEED_OF_PART]
    force = row[at.STIFFNESS] * d
    if mode[at.DAMPER] == 1:
        force += row[at.DAMPING] * rate
    for i in range(program[at.CONTACT], program[at.CONTACT + 1], 2):
        force += invoke(program[i], d, rate, row[at.STIFFNESS], row[at.DAMPING], row, program[i + 1])
    return force


@compiled
def contact_force(
    z: FloatPointer, speed: float, mode: IntPointer, row: FloatPointer, program: IntPointer
) -> float:
    """Force of the actuator on the part, positive in compression, negative in adhesion [N]."""
    if mode[at.ZONE] == at.TOUCHING:
        return 0.0 if mode[at.CLIPPED] == 1 else compression(z, speed, mode, row, program)
    force = 0.0
    if mode[at.ZONE] == at.NEAR:
        for i in range(program[at.PULL], program[at.PULL + 1], 2):
            force -= invoke(program[i], z[at.U] - z[at.TRAVEL], 0.0, 0.0, 0.0, row, program[i + 1])
    return force


@compiled
def body_force(
    t: float, z: FloatPointer, memo: FloatPointer, row: FloatPointer, program: IntPointer
) -> float:
    """Sum up the forces on the part other than contact and Coulomb friction, along the tap [N]."""
    direction = row[at.DIRECTION]
    force = memo[at.DRIVE] + memo[at.DRIVE_SLOPE] * (t - memo[at.DRIVE_TIME])
    if program[at.BODY + 1] > program[at.BODY]:
        x = row[at.START] + direction * z[at.U]
        velocity = direction * z[at.SPEED_OF_PART]
        for i in range(program[at.BODY], program[at.BODY + 1], 2):
            force += invoke(program[i], x, velocity, row[at.MASS], row[at.GRAVITY], row, program[i + 1])
    return direction * force


@compiled
def friction_scale(u: float, row: FloatPointer, program: IntPointer) -> float:
    """Product of the laws by which friction varies along the table [1]."""
    scale = 1.0
    x = row[at.START] + row[at.DIRECTION] * u
    for i in range(program[at.SCALE], program[at.SCALE + 1], 2):
        scale *= invoke(program[i], x, 0.0, 0.0, 0.0, row, program[i + 1])
    return scale


@compiled
def kinetic_friction(u: float, speed: float, row: FloatPointer, program: IntPointer) -> float:
    """Magnitude of Coulomb friction in slip at `speed` >= 0 [N]."""
    mu = row[at.MU_K]
    for i in range(program[at.KINETIC], program[at.KINETIC + 1], 2):
        mu += invoke(program[i], speed, 0.0, 0.0, 0.0, row, program[i + 1])
    return mu * friction_scale(u, row, program) * row[at.MASS] * row[at.GRAVITY]


@compiled
def breakaway_force(u: float, row: FloatPointer, program: IntPointer) -> float:
    """Force that stick can hold [N].

    mu_s m g; where the friction of slow slip is larger than that, the part only moves once it is exceeded.
    """
    static = row[at.MU_S] * friction_scale(u, row, program) * row[at.MASS] * row[at.GRAVITY]
    return max(static, kinetic_friction(u, 0.0, row, program))


@compiled
def derivative(
    t: float,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    out: FloatPointer,
    begin: int,
) -> None:
    """Equations of motion (1)-(3) of the present phase, into `out` from index `begin` on."""
    speed = actuator_speed(t, z, mode, row, program)
    slip = mode[at.SLIP]
    force = 0.0
    if mode[at.ZONE] >= at.NEAR:
        force = contact_force(z, speed, mode, row, program)
    if slip == 0:
        out[begin + at.U] = 0.0
        out[begin + at.SPEED_OF_PART] = 0.0
    else:
        total = force + body_force(t, z, memo, row, program)
        if slip == at.ELASTIC:
            total -= memo[at.STICK_STIFFNESS] * (z[at.U] - memo[at.ANCHOR])
        else:
            total -= slip * kinetic_friction(z[at.U], slip * z[at.SPEED_OF_PART], row, program)
        out[begin + at.U] = z[at.SPEED_OF_PART]
        out[begin + at.SPEED_OF_PART] = total / row[at.MASS]
    out[begin + at.TRAVEL] = speed
    for i in range(at.EXTRA, mode[at.STATES]):
        law = program[at.LOSS] + 2 * (i - at.EXTRA)
        lost = 0.0
        if mode[at.RUNNING] == 1:
            lost = invoke(program[law], z[i], force, 0.0, 0.0, row, program[law + 1])
        out[begin + i] = lost


@compiled
def reading(force: float, row: FloatPointer, program: IntPointer) -> float:
    """Apply the sensor's laws to a contact force that has been through its lag [N]."""
    for i in range(program[at.READING], program[at.READING + 1], 2):
        force = invoke(program[i], force, 0.0, 0.0, 0.0, row, program[i + 1])
    return force
