"""Where things lie in the flat arrays that compiled code works on, and how compiled functions get them.

`parameters` holds the numbers of one tap, then the parameters of every law at work; `laws` says which laws
those are; `contact_mode` and `cache` hold what is constant within one smooth phase; `outputs` is what comes
out of a tap. Every number below is an index into one of these arrays, or a value that one of them holds.
"""

from typing import Final, NamedTuple

from impactcell.numerics.jit import FloatPointer, IntArray, IntPointer
from impactcell.records import Samples

# Parameters: the nominal plant and one tap, SI
STIFFNESS: Final = 0  # k of the contact
DAMPING: Final = 1  # b of the contact
MU_S: Final = 2  # static coefficient of friction
MU_K: Final = 3  # kinetic coefficient of friction
MASS: Final = 4  # of the part
GRAVITY: Final = 5  # acceleration of free fall
VELOCITY: Final = 6  # commanded, of the actuator
STROKE: Final = 7  # travel at which the actuator halts
DIRECTION: Final = 8  # +1 or -1
START: Final = 9  # position on the table at which the part lies
HALTS_AT_SEPARATION: Final = 10  # 1 where the actuator halts at the first loss of contact
INITIAL_SPEED: Final = 11  # of a part without an actuator; nan where an actuator strikes
FIRST_EFFECT_PARAMETER: Final = 12  # the laws' own parameters begin here

# Laws: for each kind of law where its list of (address, offset in the parameters) begins
BODY: Final = 0  # what each kind means says `impactcell.physics.effect.LawKind`
SCALE: Final = 1  # factor of both coefficients
KINETIC: Final = 2  # addend of mu_k
CONTACT: Final = 3  # addend of the contact force
PULL: Final = 4  # attraction over a gap
REACH: Final = 5  # of the attraction
SPEED: Final = 6  # factor of the actuator's speed
UNTIL: Final = 7  # time of a kink of SPEED
LOSS: Final = 8  # speed lost under load
READING: Final = 9  # of the force sensor
LAG: Final = 10  # of the force sensor
DELAY: Final = 11  # of the force channel
STICK: Final = 12  # stiffness of stick
POSITION_LAG: Final = 13  # of the position sensor
LAW_KINDS: Final = 14  # how many kinds there are

# Contact mode: whole numbers that are constant within a smooth phase
SLIP: Final = 0  # -1, +1: sense of slip along the tap; 0: rigid stick; 2: elastic stick
ZONE: Final = 1  # how far the part is from the actuator
DAMPER: Final = 2  # 1 while the contact is being compressed
CLIPPED: Final = 3  # 1 while the contact laws would pull
RUNNING: Final = 4  # 1 while the actuator moves
DRIVE_INTERVAL: Final = 5  # of the driving force
STATE_COUNT: Final = 6  # length of the state
MODE_COUNT: Final = 7  # length of the contact mode

ABSENT: Final = 0  # value of ZONE: no actuator at all
FAR: Final = 1  # value of ZONE: beyond the reach of adhesion
NEAR: Final = 2  # value of ZONE: within the reach of adhesion
TOUCHING: Final = 3  # value of ZONE: in contact
ELASTIC: Final = 2  # value of SLIP: elastic stick

# Phase cache: numbers that are constant within a smooth phase
ANCHOR: Final = 0  # position at which elastic stick bears no force [m]
STICK_STIFFNESS: Final = 1  # 0: rigid [N/m]
ADHESION_REACH: Final = 2  # [m]
LAG_S: Final = 3  # of the force sensor
DELAY_S: Final = 4  # of the force channel
NEXT_KINK_S: Final = 5  # next time at which a law changes its formula
LAGGED_FORCE: Final = 6  # the sensor's state at the begin of the step [N]
NATURAL_STEP_S: Final = 7  # first step to try
DRIVE: Final = 8  # driving force at DRIVE_TIME [N]
DRIVE_SLOPE: Final = 9  # of the driving force [N/s]
DRIVE_TIME: Final = 10  # [s]
RESTING_FROM_S: Final = 11  # when elastic stick began to ring, inf while it does not
FORCE_POWERS: Final = 12  # coefficients of the contact force over a step, in powers of its fraction [N]
LAG_MOMENTS: Final = 22  # room for the response of a sensor's lag to each of those powers [1]
POSITION_POWERS: Final = 32  # the same for how far the part goes over a step [m]
POSITION_LAG_S: Final = 42  # of the position sensor
LAGGED_POSITION: Final = 43  # the position sensor's state at the begin of the step, along the tap [m]
CACHE_COUNT: Final = 44  # length of the phase cache

# State
ADVANCE: Final = 0  # of the part from its start, along the tap [m]
PART_SPEED: Final = 1  # along the tap [m/s]
TRAVEL: Final = 2  # of the actuator from first contact [m]
FIRST_EXTRA_STATE: Final = 3  # states of the effects begin here
STATE_WIDTH: Final = 8  # room for the state in a row of the stages or of the interpolant

# Events that end a phase, in the order in which simultaneous ones are handled
STOP: Final = 0  # of slip
BREAKAWAY: Final = 1  # of stick
GAP: Final = 2  # contact is lost or made
RATE: Final = 3  # compression begins or ends
CLIP: Final = 4  # the contact laws begin or cease to pull
WITHIN_REACH: Final = 5  # adhesion begins or ends
STROKE_END: Final = 6  # the actuator halts
EVENT_TYPES: Final = 7  # how many types there are

# Kinds of recorded events
WAS_BREAKAWAY: Final = 0  # `TapEventKind.BREAKAWAY`
WAS_CONTACT: Final = 1  # `TapEventKind.CONTACT`
WAS_SEPARATION: Final = 2  # `TapEventKind.SEPARATION`
WAS_STOP: Final = 3  # `TapEventKind.STOP`
WAS_HALT: Final = 4  # `TapEventKind.HALT`

# Sample index: index of the next sample of each channel, then where each channel ends, then room for events
FORCE: Final = 0  # channel: contact force as the sensor shows it [N]
POSITION: Final = 1  # channel: of the part along +1, from its start, as the sensor shows it [m]
ACTUATOR: Final = 2  # channel: of the actuator along +1 [m]
PART_VELOCITY: Final = 3  # channel: of the part along +1 [m/s]
CHANNEL_COUNT: Final = 4  # how many channels there are
EVENT_ROOM: Final = 8  # how many events may be recorded
SAMPLE_INDEX_COUNT: Final = 9  # length of the sample index of a tap

# How far to integrate
TO_LAST_SAMPLE: Final = 0  # as far as samples are asked for
TO_REST: Final = 1  # until all outputs are known

# Outputs of a tap
PEAK_FORCE: Final = 0  # as the sensor shows it, over all contacts [N]
DISPLACEMENT: Final = 1  # from first contact to rest, along the tap [m]
DISTANCE: Final = 2  # from the last loss of contact to rest, along the tap [m]
BREAKAWAY_TIME: Final = 3  # of the first breakaway [s]
SEPARATION_TIME: Final = 4  # of the last loss of contact [s]
STOP_TIME: Final = 5  # of the last stop [s]
HALT_TIME: Final = 6  # of the actuator [s]
STATUS: Final = 7  # how the integration ended
EVENT_COUNT: Final = 8  # recorded or not
STEP_COUNT: Final = 9  # accepted and refused steps
OUTPUT_COUNT: Final = 10  # length of the outputs of a tap

AT_REST: Final = 0.0  # value of STATUS
STILL_MOVING: Final = 1.0  # value of STATUS: at the end of the time allowed
TOO_MANY_EVENTS: Final = 2.0  # value of STATUS
NOT_FINITE: Final = 3.0  # value of STATUS: the laws gave no numbers
TOO_MANY_STEPS: Final = 4.0  # value of STATUS: far more than a tap needs, as of one that gains energy


class SmoothPhase(NamedTuple):
    """What the equations of motion of one smooth phase are made of."""

    parameters: FloatPointer
    laws: IntPointer
    contact_mode: IntPointer
    cache: FloatPointer


class StepBuffers(NamedTuple):
    """State before and after a step, room for a trial of it, the method's stages, and the interpolant.

    `stages` has a row of STATE_WIDTH numbers for each stage, `interpolant` one for each coefficient.
    """

    state: FloatPointer
    next_state: FloatPointer
    trial_state: FloatPointer
    stages: FloatPointer
    interpolant: FloatPointer


class TapRecord(NamedTuple):
    """Where samples, events and outputs of a tap go."""

    outputs: FloatPointer
    sample_index: IntPointer
    sample_times: FloatPointer
    samples: FloatPointer
    event_kinds: IntPointer
    event_times: FloatPointer


class DrivingForce(NamedTuple):
    """A measured force along +1: ascending times, then as many values; none with fewer than 2 `samples`."""

    values: FloatPointer
    samples: int


class TapArrays(NamedTuple):
    """The taps to integrate.

    Attributes
    ----------
    parameters : ndarray, shape (n, width)
        The numbers of each tap, as above.
    laws : ndarray of int
    drives : ndarray
        For each tap the times, then the values, of a driving force along +1, linear in between.
    drive_ends : ndarray of int, shape (n + 1,)
        Where each tap's part of `drives` ends; equal to the one before where nothing drives.
    """

    parameters: Samples
    laws: IntArray
    drives: Samples
    drive_ends: IntArray


class SampleArrays(NamedTuple):
    """The samples asked for, and room for samples and events.

    Attributes
    ----------
    sample_index : ndarray of int, shape (n, SAMPLE_INDEX_COUNT)
        For each channel the index of its first sample and the index after its last; room for events.
        They are used up.
    times, samples : ndarray
        Sample times, sorted within each channel, and where the samples go.
    event_kinds, event_times : ndarray
        Filled with as many events of the last tap as there is room for.
    """

    sample_index: IntArray
    times: Samples
    samples: Samples
    event_kinds: IntArray
    event_times: Samples
