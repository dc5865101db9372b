"""From when until when a certificate holds, and who is told."""

import datetime as dt
import logging
from pathlib import Path
from typing import Final

from cryptography import x509

_log = logging.getLogger(__name__)

SOON: Final = dt.timedelta(days=30)
"""So long before its end a certificate is told to end: time to have a new one trusted."""
ANOTHER_FOR_THE_PAGE: Final = (
    "browsers refuse a page whose certificate does not hold; put another in its place, which the page uses "
    "from the next start of the service on"
)
"""What to do about the page's certificate."""


def validity_doubt(certificate: x509.Certificate, now: dt.datetime) -> str:
    """Say that a certificate has ended, ends soon or is not valid yet; empty where it holds for long."""
    begin, end = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    if now < begin:
        return f"is not valid before {begin:%Y-%m-%d}; if it is not {now:%Y-%m-%d}, set this machine's clock"
    if now > end:
        return f"ended on {end:%Y-%m-%d}"
    return f"ends on {end:%Y-%m-%d}" if now > end - SOON else ""


def validity_mark(certificate: x509.Certificate, now: dt.datetime) -> str:
    """Say in a word that a certificate does not hold now; empty where it does."""
    if now < certificate.not_valid_before_utc:
        return "not yet valid"
    return "ended" if now > certificate.not_valid_after_utc else ""


class CertificateWatch:
    """Tells in the log, at first and then once a day, that a certificate does not hold or soon will not.

    Parameters
    ----------
    certificate : x509.Certificate
    file : Path
        Where it lies.
    way_out : str
        What to do about it.
    """

    def __init__(self, certificate: x509.Certificate, file: Path, way_out: str) -> None:
        self._certificate = certificate
        self._file = file
        self._way_out = way_out
        self._looked: dt.date | None = None

    def look(self, now: dt.datetime) -> None:
        """Look whether it holds, if that was not done today."""
        if now.date() == self._looked:
            return
        self._looked = now.date()
        if doubt := validity_doubt(self._certificate, now):
            _log.warning("%s: %s: %s", self._file, doubt, self._way_out)
