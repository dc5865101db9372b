"""What is said of a model that simulated by itself follows little of what was held out, in two languages."""

from typing import Final

POOR_FIT_PERCENT: Final = 50.0
"""Fit 100 (1 - error over variation) below which a simulation is said to follow poorly: its error is half of
what was to be explained. Our choice."""


def open_loop_sentence(channel: str, fit_percent: float, unit: str) -> str:
    """Say where the open-loop simulation of held-out records follows them poorly or not at all; else nothing.

    Parameters
    ----------
    channel : str
        What was simulated.
    fit_percent : float
        Of the final model; below 0 a constant is nearer.
    unit : str
        What was held out: shots, blocks, records.

    Examples
    --------
    >>> open_loop_sentence("position", 36.0, "shots")
    'Simulated open loop, the model follows the held-out position poorly: it errs 0.64 times as much as a \
constant.'
    >>> open_loop_sentence("position", 50.0, "shots")
    ''
    """
    if not fit_percent < POOR_FIT_PERCENT:
        return ""
    how = "follows the held-out {} poorly" if fit_percent > 0.0 else "does not follow the held-out {}"
    said = (
        f"Simulated open loop, the model {how.format(channel)}: "
        f"it errs {_over_constant(fit_percent)} times as much as a constant."
    )
    if fit_percent > 0.0:
        return said
    return (
        f"{said} See whether all {unit} are of one machine in one state, or whether the model lacks "
        "something, as its damping."
    )


def german_open_loop_sentence(channel: str, fit_percent: float) -> str:
    """Say the same in German; so is the channel.

    >>> german_open_loop_sentence("Position", 36.0)
    'Ohne Rückführung simuliert folgt das Modell dem Zurückgehaltenen schlecht (Position): es irrt 0,64-mal \
so viel wie eine Konstante.'
    """
    if not fit_percent < POOR_FIT_PERCENT:
        return ""
    how = "schlecht" if fit_percent > 0.0 else "nicht"
    said = (
        f"Ohne Rückführung simuliert folgt das Modell dem Zurückgehaltenen {how} ({channel}): "
        f"es irrt {_over_constant(fit_percent).replace('.', ',')}-mal so viel wie eine Konstante."
    )
    if not fit_percent > 0.0:
        said += (
            " Zu prüfen ist, ob alle Messungen von einer Maschine in einem Zustand sind, oder ob dem Modell "
            "etwas fehlt, etwa seine Dämpfung."
        )
    return said


def better_sentence(phrase: str, rmse: tuple[float, float], unit: str) -> str:
    """Say by how much less the simulation errs with a term that blocks do not show.

    Parameters
    ----------
    phrase : str
        The term.
    rmse : (float, float)
        Without and with it.
    unit : str

    Examples
    --------
    >>> better_sentence("viscous friction", (0.0813, 0.0305), "rad")
    'With viscous friction held-out records, simulated open loop, are 0.0305 rad off, 0.0813 without.'
    """
    return (
        f"With {phrase} held-out records, simulated open loop, are {rmse[1]:.3g} {unit} off, "
        f"{rmse[0]:.3g} without."
    )


def german_better_sentence(phrase: str, rmse: tuple[float, float], unit: str) -> str:
    """Say the same in German; so is the term.

    >>> german_better_sentence("Viskose Reibung", (0.0813, 0.0305), "rad")
    'Viskose Reibung hinzugenommen, liegt Zurückgehaltenes ohne Rückführung simuliert 0,0305 rad daneben, \
sonst 0,0813.'
    """
    without, beside = (f"{value:.3g}".replace(".", ",") for value in rmse)
    return (
        f"{phrase} hinzugenommen, liegt Zurückgehaltenes ohne Rückführung simuliert {beside} {unit} daneben, "
        f"sonst {without}."
    )


def _over_constant(fit_percent: float) -> str:
    """Error over that of the mean of what was held out: what 100 (1 - error over variation) is made of."""
    return f"{1.0 - fit_percent / 100.0:.3g}"
