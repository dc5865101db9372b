"""What the name of a column says of its quantity, in English and German."""

import enum
import re
from dataclasses import dataclass

from impactcell.measurements.notation.units import Dimension
from impactcell.measurements.table import AGAIN


class ColumnMeaning(enum.StrEnum):
    """What a column can be for a campaign."""

    TIME = "time"
    FORCE = "force"
    POSITION = "position"
    ACTUATOR = "actuator"
    SHOT = "shot"
    VELOCITY = "velocity"
    MASS = "mass"
    DIRECTION = "direction"
    BATCH = "batch"
    DWELL = "dwell"
    START = "start"
    COVARIATE = "covariate"
    IGNORED = "ignored"


CHANNELS = (ColumnMeaning.FORCE, ColumnMeaning.POSITION, ColumnMeaning.ACTUATOR)
"""Quantities that vary within a shot."""


@dataclass(frozen=True, slots=True)
class Words:
    """Names under which a quantity is met.

    Attributes
    ----------
    words : str
        Separated by spaces, lower case, umlauts written out; a name of several is joined by an underscore.
    symbols : str
        Signs of a formula, which alone say less.
    dimensions : tuple of Dimension
        Units that fit; the first is that of translation.
    """

    words: str
    symbols: str
    dimensions: tuple[Dimension, ...]


VOCABULARY = {
    ColumnMeaning.TIME: Words(
        "time zeit timestamp elapsed zeitstempel messzeit datetime datum uhrzeit timestamps relzeit x_value",
        "t",
        (Dimension.TIME,),
    ),
    ColumnMeaning.FORCE: Words(
        "force kraft contact_force kontaktkraft load_cell kraftsensor kraftaufnehmer dms torque moment "
        "drehmoment drive_force antriebskraft loadcell effort trq",
        "f fx fz f1 m tau",
        (Dimension.FORCE, Dimension.TORQUE),
    ),
    ColumnMeaning.POSITION: Words(
        "position weg pos displacement lage verschiebung auslenkung part_position teil bauteil werkstueck "
        "part "
        "slider travel encoder angle winkel laser wegsensor distance displ",
        "x s q theta phi alpha x1 qm",
        (Dimension.LENGTH, Dimension.ANGLE),
    ),
    ColumnMeaning.ACTUATOR: Words(
        "actuator aktor aktuator ram stoessel pusher plunger tool schieber stempel actuator_position axis "
        "achse "
        "antriebsweg",
        "y z",
        (Dimension.LENGTH, Dimension.ANGLE),
    ),
    ColumnMeaning.SHOT: Words(
        "shot cycle schuss versuch zyklus hub trial run stroke_number shot_number versuchsnummer tap messung",
        "nr n",
        (Dimension.NONE,),
    ),
    ColumnMeaning.VELOCITY: Words(
        "velocity geschwindigkeit vorschub speed velo vel feed commanded_velocity tempo feedrate",
        "v",
        (Dimension.VELOCITY, Dimension.ANGULAR_VELOCITY),
    ),
    ColumnMeaning.MASS: Words(
        "mass masse gewicht weight part_mass inertia traegheit traegheitsmoment",
        "m j",
        (Dimension.MASS, Dimension.INERTIA),
    ),
    ColumnMeaning.DIRECTION: Words("direction richtung dir", "", (Dimension.NONE,)),
    ColumnMeaning.BATCH: Words("batch charge los lot material batch_id chargennummer", "", (Dimension.NONE,)),
    ColumnMeaning.DWELL: Words("dwell liegezeit wartezeit ruhezeit dwell_time", "", (Dimension.TIME,)),
    ColumnMeaning.START: Words("start start_position startposition startlage", "", (Dimension.LENGTH,)),
}
"""How columns are called."""
SPEED_OF = {Dimension.LENGTH: Dimension.VELOCITY, Dimension.ANGLE: Dimension.ANGULAR_VELOCITY}
"""What a position changes by in time; a column of it that is given as the position is summed up."""
ROTATION_WORDS = frozenset(
    ("torque", "moment", "drehmoment", "tau", "trq", "angle", "winkel", "encoder", "theta", "phi", "alpha")
)
"""Of these the words that are met of a rotation."""

WORD_MATCH, TOKEN_MATCH, SYMBOL_MATCH = 0.65, 0.55, 0.4
"""How sure a name makes one: the whole name, a word of it, a letter."""
UNIT_MATCH, UNIT_ALONE = 0.3, 0.45
"""What a unit that fits adds to a name, and how sure it makes one alone."""
COMMAND_WORDS = frozenset(
    (
        "enable",
        "enabled",
        "goal",
        "target",
        "setpoint",
        "soll",
        "sollwert",
        "status",
        "flag",
        "command",
        "raw",
        "des",
        "desired",
        "cmd",
        "ref",
        "reference",
        "con",
        "fric",
    )
)
"""Words of a name that say that it was not measured."""
MEASURED_WORDS = frozenset((
    "meas", "measured", "act", "actual", "ist", "m", "mes", "msr", "joint", "j", "motor", "link",
))  # fmt: skip
"""Words beside a sign of a formula that leave it what it is: q that was measured, or of a motor or joint."""
SPEED_NAMES = frozenset((
    "omega", "w", "rpm", "drehzahl", "winkelgeschwindigkeit", "dq", "qd", "qdot", "dtheta", "thetad",
    "thetadot", "dphi", "phidot", "dalpha", "alphadot", "xdot", "ydot", "vx", "vy", "vz", "dot",
))  # fmt: skip
"""Words and signs of a speed beside those of the velocity of a shot."""
ACCELERATION_NAMES = frozenset((
    "ddq", "qdd", "qddot", "ddtheta", "thetaddot", "ddphi", "ddalpha", "xddot", "ddot",
))  # fmt: skip
"""Signs of an acceleration."""
JOINT_SIGNS = frozenset(("q", "theta", "phi", "alpha", "tau"))
"""Signs that are numbered by joints, as of the seventh q."""
RATE_WORDS = "sample_rate sampling_rate rate_hz abtastrate samplerate fs sampling_frequency abtastfrequenz"
"""Names under which a file says how often it was sampled."""
STEP_WORDS = (
    "dt dx sample_interval wf_increment abtastzeit sampling_interval abtastintervall delta_x increment "
    "interval sampling_time_interval"
)
"""Names under which a file says the step of its time."""


def normalised(name: str) -> str:
    """Lower case, words joined by underscores, umlauts written out.

    Examples
    --------
    >>> normalised("Stößel-Weg"), normalised("partPosition"), normalised("x'")
    ('stoessel_weg', 'part_position', 'x')
    """
    text = re.sub(r"(?<=[a-zäöü])(?=[A-ZÄÖÜ])", "_", name).lower()
    for sign, plain in (
        ("ä", "ae"),
        ("ö", "oe"),
        ("ü", "ue"),
        ("ß", "ss"),
        ("θ", "theta"),
        ("φ", "phi"),
        ("τ", "tau"),
        ("α", "alpha"),
        ("ω", "omega"),
    ):
        text = text.replace(sign, plain)
    return re.sub(r"[^a-z0-9]+", "_", text).strip("_")


def is_kind_of(name: str, meaning: ColumnMeaning) -> bool:
    """Whether a German compound ends in a word of the quantity, which says what it is a kind of.

    Examples
    --------
    >>> is_kind_of("Teilemasse", ColumnMeaning.MASS), is_kind_of("Massenträger", ColumnMeaning.MASS)
    (True, False)
    """
    words = (word for word in VOCABULARY[meaning].words.split() if len(word) >= 4)
    return normalised(name).endswith(tuple(words))


def name_score(name: str, meaning: ColumnMeaning) -> tuple[float, str]:
    """How sure the name of a column makes that it is of this quantity, 0 to 1, and the word that says so."""
    words = VOCABULARY[meaning]
    text = normalised(AGAIN.sub("", name))  # a name that comes again is as good as the first
    known, symbols = words.words.split(), words.symbols.split()
    if text in known:
        return WORD_MATCH, text
    if text in symbols:
        return SYMBOL_MATCH, text
    if COMMAND_WORDS & set(_tokens(text)) and meaning not in (
        ColumnMeaning.VELOCITY,
        ColumnMeaning.DIRECTION,
    ):
        return 0.0, ""
    if _sign(text) in symbols:
        return SYMBOL_MATCH, _sign(text)
    tokens = _tokens(text)
    for word in known:
        parts = word.split("_")
        if all(part in tokens for part in parts):
            return TOKEN_MATCH, word
    for word in known:
        # German joins words: Kontaktkraftsensor
        if len(word) >= 4 and any(word in token for token in tokens):
            return TOKEN_MATCH - 0.1, word
    return 0.0, ""


def rate_name(name: str) -> str:
    """Say whether a column is called as a speed or as an acceleration of a position; empty where as neither.

    Examples
    --------
    >>> rate_name("dq7"), rate_name("theta_ddot"), rate_name("Kraft")
    ('speed', 'acceleration', '')
    """
    text = normalised(AGAIN.sub("", name))
    words = {token for token in _tokens(text) if token}
    if words & COMMAND_WORDS:
        return ""
    if words & ACCELERATION_NAMES:
        return "acceleration"
    is_speed = words & SPEED_NAMES or name_score(name, ColumnMeaning.VELOCITY)[0] > 0.0
    return "speed" if is_speed else ""


def _tokens(text: str) -> list[str]:
    """Give the words of a normalised name without the numbers behind them."""
    return [re.sub(r"\d+$", "", token) for token in text.split("_")]


def _sign(text: str) -> str:
    """Give the sign of a formula that a normalised name is but for a joint's number and words; else empty."""
    signs = [token for token in _tokens(text) if token and token not in MEASURED_WORDS]
    is_numbered = any(sign.isdigit() for sign in text)
    return signs[0] if len(signs) == 1 and (not is_numbered or signs[0] in JOINT_SIGNS) else ""
