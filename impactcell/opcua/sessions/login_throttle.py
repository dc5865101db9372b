"""Guessing passwords becomes slow, for who guesses and for nobody else.

A right password is answered at once. A wrong one is answered after a delay that grows with each, and its turn
is taken until then: who hangs up and tries again on another connection finds fewer turns, not a shorter
delay. Turns are counted for a user name as tried from one address, and for the address; a client that has
proved both its certificate and the user's password before has turns of its own, so that guesses from its
address, or of its user's password from elsewhere, do not make it wait.
"""

import asyncio
import contextlib
import time
from collections import OrderedDict
from collections.abc import AsyncIterator
from typing import Final

UNDELAYED_FAILURES: Final = 4
"""Wrong passwords an address may send without a delay: people mistype."""
FIRST_DELAY_S: Final = 0.25
"""Delay of the answer to the next one; it doubles with each."""
MAX_DELAY_S: Final = 8.0
"""Longest delay, seconds: with the turns below an address tries a user name 32 000 times a day at most."""
TURNS_PER_NAME: Final = 3
"""Attempts that may wait for their answer at a time: for one user name from one address."""
TURNS_PER_ADDRESS: Final = 16
"""The same for an address, whatever the name."""
FORGET_AFTER_S: Final = 900.0
"""Wrong passwords count no more when nothing has been tried for so long."""
MAX_ENTRIES: Final = 4_096
"""Addresses, names at addresses, and known clients remembered at once; some 2 MB."""


class _Entry:
    """Wrong passwords of one name or address, and the turns it has."""

    __slots__ = ("failures", "last_attempt_s", "turns")

    def __init__(self, turns: int) -> None:
        self.failures = 0
        self.last_attempt_s = 0.0
        self.turns = asyncio.Semaphore(turns)


class Attempt:
    """One password that is being checked."""

    def __init__(self, entries: list[_Entry]) -> None:
        self._entries = entries
        self.delay_s = 0.0

    def succeeded(self) -> None:
        """Forget the wrong passwords that went before under this name."""
        failures = self._entries[0].failures
        for entry in self._entries:
            entry.failures -= failures

    def failed(self) -> int:
        """Count a wrong password; how many there were. `delay_s` is how long its answer has to wait."""
        for entry in self._entries:
            entry.failures += 1
        failures = max(entry.failures for entry in self._entries)
        self.delay_s = delay_s(failures)
        return failures


class LoginThrottle:
    """Decides when a password may be checked, and when its answer may go out."""

    def __init__(self) -> None:
        self._entries: OrderedDict[tuple[str, ...], _Entry] = OrderedDict()

    @contextlib.asynccontextmanager
    async def attempt(self, address: str, name: str, client: str) -> AsyncIterator[Attempt]:
        """Wait for a turn to check a password, and give it back once its answer is due.

        Parameters
        ----------
        client : str
            Fingerprint of the client's certificate; empty without one.
        """
        if client and ("client", client, name) in self._entries:
            entries = [self._entry(TURNS_PER_NAME, "client", client, name)]
        else:
            entries = [
                self._entry(TURNS_PER_NAME, "name", address, name),
                self._entry(TURNS_PER_ADDRESS, "address", address),
            ]
        attempt, taken = Attempt(entries), list[_Entry]()

        def give_back() -> None:
            for entry in taken:
                entry.turns.release()

        try:
            for entry in entries:
                await entry.turns.acquire()
                taken.append(entry)
            now = time.monotonic()
            for entry in entries:
                if now - entry.last_attempt_s > FORGET_AFTER_S:
                    entry.failures = 0
                entry.last_attempt_s = now
            yield attempt
        finally:
            # Whoever has hung up meanwhile has used up the turn all the same.
            if attempt.delay_s > 0.0:
                asyncio.get_running_loop().call_later(attempt.delay_s, give_back)
            else:
                give_back()

    def remember(self, name: str, client: str) -> None:
        """Give a client that has proved certificate and password turns of its own."""
        if client:
            self._entry(TURNS_PER_NAME, "client", client, name)

    def _entry(self, turns: int, *key: str) -> _Entry:
        entry = self._entries.get(key)
        if entry is None:
            entry = self._entries[key] = _Entry(turns)
            while len(self._entries) > MAX_ENTRIES:
                self._entries.popitem(last=False)
        self._entries.move_to_end(key)
        return entry


def delay_s(failures: int) -> float:
    """Delay of the answer to a wrong password, by how many there were, this one included.

    >>> [delay_s(n) for n in (4, 5, 6, 50)]
    [0.0, 0.25, 0.5, 8.0]
    """
    if failures <= UNDELAYED_FAILURES:
        return 0.0
    doublings = min(failures - UNDELAYED_FAILURES - 1, 16)
    return min(FIRST_DELAY_S * 2.0**doublings, MAX_DELAY_S)
