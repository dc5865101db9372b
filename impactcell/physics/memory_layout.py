"""Where things lie in the flat arrays that compiled code works on.

A `row` holds the numbers of one tap, then the parameters of every law at work; a `program` says which laws
those are; `mode` and `memo` hold what is constant within one smooth phase; `figures` is what came out.
"""

from typing import Final

# row: the nominal plant and one tap
STIFFNESS: Final = 0
DAMPING: Final = 1
MU_S: Final = 2
MU_K: Final = 3
MASS: Final = 4
GRAVITY: Final = 5
VELOCITY: Final = 6
STROKE: Final = 7
DIRECTION: Final = 8
START: Final = 9
HALTS_AT_SEPARATION: Final = 10
INITIAL_SPEED: Final = 11
NOMINAL: Final = 12

# program: for each kind of law where its list of (address, offset in the row) begins
BODY: Final = 0
SCALE: Final = 1
KINETIC: Final = 2
CONTACT: Final = 3
PULL: Final = 4
REACH: Final = 5
SPEED: Final = 6
UNTIL: Final = 7
LOSS: Final = 8
READING: Final = 9
LAG: Final = 10
DELAY: Final = 11
STICK: Final = 12
KINDS: Final = 13

# mode: whole numbers that are constant within a smooth phase
SLIP: Final = 0  # -1, +1: sense of slip along the tap; 0: rigid stick; 2: elastic stick
ZONE: Final = 1
DAMPER: Final = 2  # 1 while the contact is being compressed
CLIPPED: Final = 3  # 1 while the contact laws would pull
RUNNING: Final = 4  # 1 while the actuator moves
INTERVAL: Final = 5  # of the driving force
STATES: Final = 6  # length of the state
MODES: Final = 7

ABSENT: Final = 0  # values of ZONE: no actuator at all
FAR: Final = 1
NEAR: Final = 2  # within the reach of adhesion
TOUCHING: Final = 3
ELASTIC: Final = 2  # value of SLIP

# memo: numbers that are constant within a smooth phase
ANCHOR: Final = 0
STICK_STIFFNESS: Final = 1  # 0: rigid
ADHESION_REACH: Final = 2
LAG_S: Final = 3
DELAY_S: Final = 4
NEXT_KINK_S: Final = 5
LAGGED_FORCE: Final = 6
NATURAL_STEP_S: Final = 7
DRIVE: Final = 8  # driving force at DRIVE_TIME, and its slope
DRIVE_SLOPE: Final = 9
DRIVE_TIME: Final = 10
RESTING_FROM_S: Final = 11  # when elastic stick began to ring, inf while it does not
MEMOS: Final = 12

# state: u along the tap from the start, its speed, travel of the actuator, states of the effects
U: Final = 0
SPEED_OF_PART: Final = 1
TRAVEL: Final = 2
EXTRA: Final = 3
WIDTH: Final = 8  # room for the state in a row of K or of the interpolant

# events, in the order in which simultaneous ones are handled
STOP: Final = 0
BREAKAWAY: Final = 1
GAP: Final = 2
RATE: Final = 3
CLIP: Final = 4
WITHIN_REACH: Final = 5
STROKE_END: Final = 6
EVENTS: Final = 7

# kinds of recorded events
WAS_BREAKAWAY: Final = 0
WAS_CONTACT: Final = 1
WAS_SEPARATION: Final = 2
WAS_STOP: Final = 3
WAS_HALT: Final = 4

# cursor: index of the next sample of each channel, where each channel ends, and room for events
CHANNELS: Final = 4  # force, position, actuator, velocity
FORCE: Final = 0
POSITION: Final = 1
ACTUATOR: Final = 2
PART_VELOCITY: Final = 3
ROOM: Final = 8
CURSORS: Final = 9

# how far to integrate
TO_LAST_SAMPLE: Final = 0
TO_REST: Final = 1

# figures
PEAK_FORCE: Final = 0
DISPLACEMENT: Final = 1
DISTANCE: Final = 2
BREAKAWAY_TIME: Final = 3
SEPARATION_TIME: Final = 4
STOP_TIME: Final = 5
PEAK_TIME: Final = 6
HALT_TIME: Final = 7
STATUS: Final = 8
EVENT_COUNT: Final = 9
STEP_COUNT: Final = 10
FIGURES: Final = 11

AT_REST: Final = 0.0
STILL_MOVING: Final = 1.0
TOO_MANY_EVENTS: Final = 2.0
NOT_FINITE: Final = 3.0
