"""Which of what a PLC shows as its target is a new one."""

from dataclasses import dataclass


@dataclass(slots=True)
class PlcTargets:
    """What has been looked at of a PLC's targets."""

    _session: int = 0
    _sequence: int | None = None  # 0 where it showed none, None before the first look
    _last: tuple[int, int, float] | None = None

    def is_new(
        self, session: int, sequence: int, target_m: float, done: tuple[int, int] | None
    ) -> tuple[bool, str]:
        """Say whether a target is to be begun, and if one of another number or session is not, why.

        Parameters
        ----------
        session : int
            The module's, 0 where it has none.
        sequence : int
            Number of the target; 0 is none.
        target_m : float
        done : tuple of int, optional
            Session and number of the target whose task had ended when the service last ran.
        """
        first = self._sequence is None
        if not first and (session, sequence) == (self._session, self._sequence):
            return False, ""
        self._session, self._sequence = session, sequence
        if not sequence:
            return False, ""
        before, self._last = self._last, (session, sequence, target_m)
        if first and session and (session, sequence) == done:
            return False, "the PLC's target was done with before the restart; it is not begun again"
        if before is not None and before[0] != session and before[1:] == (sequence, target_m):
            return False, (
                "the module was started anew and shows the PLC's target of before, by its number and place; "
                "it is not begun again until target_sequence is raised"
            )
        return True, ""

    def is_another(self, sequence: int) -> bool:
        """Whether a number is that of another target than the one that was looked at last; 0 is none."""
        return self._sequence is not None and sequence not in (0, self._sequence)
