"""Logins: identity tokens in, actors out; guessing passwords becomes slow.

Checking a password takes tens of milliseconds on purpose. It happens in threads of its own, one at a time
for each address, so that somebody who guesses neither stops the server nor delays others.
"""

import asyncio
import logging
import struct
import time
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

from asyncua import ua
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import padding, rsa

from impactcell.opcua.asyncua_adapter import INVALID_SIGNATURE, SIGNATURE_CHECKS
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.host_interface import Actor, UserDirectory
from impactcell.opcua.trust_list import TrustList, fingerprint, first_of_chain, parse_certificate

_log = logging.getLogger(__name__)

UNDELAYED_FAILURES: Final = 4
"""Wrong passwords an address may send without a delay: people mistype."""
FIRST_DELAY_S: Final = 0.25
"""Delay of the answer to the next one; it doubles with each."""
MAX_DELAY_S: Final = 8.0
"""Longest delay, seconds: one address then tries fewer than 11 000 passwords a day."""
FORGET_AFTER_S: Final = 900.0
"""An address that has been silent for so long begins anew."""
MAX_ADDRESSES: Final = 4_096
"""Addresses remembered at once, some 1 MB."""
MAX_PASSWORD_BYTES: Final = 1_024
"""Longest password that is hashed."""

_OAEP: Final = {
    "http://www.w3.org/2001/04/xmlenc#rsa-oaep": hashes.SHA1,
    "http://opcfoundation.org/UA/security/rsa-oaep-sha2-256": hashes.SHA256,
}


class _AddressRecord:
    """What is known of one address: wrong passwords since the last right one, by user name."""

    __slots__ = ("failures", "last_attempt_s", "lock")

    def __init__(self) -> None:
        self.failures: dict[str, int] = {}
        self.last_attempt_s = 0.0
        self.lock = asyncio.Lock()


class LoginThrottle:
    """Delays answers to an address from its fifth wrong password on: 0.25 s, doubled each time, up to 8 s."""

    def __init__(self) -> None:
        self._addresses: OrderedDict[str, _AddressRecord] = OrderedDict()

    def record_of(self, address: str) -> _AddressRecord:
        """Look up an address; the longest unseen is forgotten when there are too many."""
        record = self._addresses.setdefault(address, _AddressRecord())
        self._addresses.move_to_end(address)
        now = time.monotonic()
        if now - record.last_attempt_s > FORGET_AFTER_S:
            record.failures.clear()
        record.last_attempt_s = now
        while len(self._addresses) > MAX_ADDRESSES:
            self._addresses.popitem(last=False)
        return record

    @staticmethod
    def delay(failures: int) -> float:
        """Delay of the answer when `wrong` passwords, this one included, were wrong.

        >>> [LoginThrottle.delay(n) for n in (4, 5, 6, 50)]
        [0.0, 0.25, 0.5, 8.0]
        """
        if failures <= UNDELAYED_FAILURES:
            return 0.0
        doublings = min(failures - UNDELAYED_FAILURES - 1, 16)
        return min(FIRST_DELAY_S * 2.0**doublings, MAX_DELAY_S)


class Authenticator:
    """Turns identity tokens into actors."""

    def __init__(self, users: UserDirectory, trust: TrustList) -> None:
        self._users = users
        self._trust = trust
        self._throttle = LoginThrottle()
        self._pool = ThreadPoolExecutor(max_workers=2, thread_name_prefix="argon2")

    def close(self) -> None:
        """End the threads."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    async def identify(
        self,
        token: Any,
        signature: ua.SignatureData,
        nonce: bytes,
        address: str,
        *,
        encrypted: bool,
    ) -> Actor:
        """Find out who a token stands for.

        Raises
        ------
        FaultError
            BadIdentityTokenRejected (a kind that is not taken), BadIdentityTokenInvalid (malformed, or made
            for another nonce), BadUserSignatureInvalid, or BadUserAccessDenied (wrong password, unknown
            user).
        """
        if isinstance(token, ua.UserNameIdentityToken):
            return await self._identify_by_password(token, nonce, address, encrypted=encrypted)
        if isinstance(token, ua.X509IdentityToken):
            return self._identify_by_certificate(token, signature, nonce, address)
        raise StatusCodeError(ua.StatusCodes.BadIdentityTokenRejected)

    async def _identify_by_password(
        self, token: ua.UserNameIdentityToken, nonce: bytes, address: str, *, encrypted: bool
    ) -> Actor:
        password = self._decrypt(token, nonce, encrypted=encrypted)
        name = token.UserName or ""
        record = self._throttle.record_of(address)
        async with record.lock:
            user = self._users.find(name)
            matches = await asyncio.get_running_loop().run_in_executor(
                self._pool, self._users.verify_password, user, password
            )
            if matches and user is not None:
                record.failures.pop(name, None)
                return Actor(user.name, user.role, address)
            record.failures[name] = record.failures.get(name, 0) + 1
            failures = sum(record.failures.values())
            _log.warning("wrong password for %r from %s, number %d", name, address, failures)
            await asyncio.sleep(LoginThrottle.delay(failures))
        raise StatusCodeError(ua.StatusCodes.BadUserAccessDenied)

    def _decrypt(self, token: ua.UserNameIdentityToken, nonce: bytes, *, encrypted: bool) -> str:
        secret = token.Password or b""
        if token.EncryptionAlgorithm:
            algorithm = _OAEP.get(token.EncryptionAlgorithm)
            if algorithm is None:
                raise StatusCodeError(ua.StatusCodes.BadIdentityTokenInvalid)
            secret = self._decrypt_secret(secret, algorithm(), nonce)
        elif not encrypted:
            raise StatusCodeError(ua.StatusCodes.BadIdentityTokenRejected)
        if len(secret) > MAX_PASSWORD_BYTES:
            raise StatusCodeError(ua.StatusCodes.BadIdentityTokenInvalid)
        try:
            return secret.decode("utf-8")
        except UnicodeDecodeError:
            raise StatusCodeError(ua.StatusCodes.BadIdentityTokenInvalid) from None

    def _decrypt_secret(self, secret: bytes, algorithm: hashes.HashAlgorithm, nonce: bytes) -> bytes:
        """Decrypt a secret in the old format of Part 4, 7.40.2.2: length, password, nonce."""
        key: rsa.RSAPrivateKey = self._trust.private_key
        block = key.key_size // 8
        if not secret or len(secret) % block or len(secret) > 8 * block:
            raise StatusCodeError(ua.StatusCodes.BadIdentityTokenInvalid)
        scheme = padding.OAEP(mgf=padding.MGF1(algorithm), algorithm=algorithm, label=None)
        try:
            plain = b"".join(
                key.decrypt(secret[at : at + block], scheme) for at in range(0, len(secret), block)
            )
            length = struct.unpack_from("<I", plain)[0]
        except (ValueError, struct.error):
            raise StatusCodeError(ua.StatusCodes.BadIdentityTokenInvalid) from None
        body = plain[4 : 4 + length]
        # asyncua takes a password made for any nonce, so that one that was listened to could be sent again.
        if len(body) != length or length < len(nonce) or body[length - len(nonce) :] != nonce:
            raise StatusCodeError(ua.StatusCodes.BadIdentityTokenInvalid)
        return body[: length - len(nonce)]

    def _identify_by_certificate(
        self, token: ua.X509IdentityToken, signature: ua.SignatureData, nonce: bytes, address: str
    ) -> Actor:
        try:
            data = first_of_chain(token.CertificateData or b"")
            certificate = parse_certificate(data)
        except ValueError:
            raise StatusCodeError(ua.StatusCodes.BadIdentityTokenInvalid) from None
        check = SIGNATURE_CHECKS.get(signature.Algorithm or "")
        if check is None or not signature.Signature:
            raise StatusCodeError(ua.StatusCodes.BadUserSignatureInvalid)
        try:
            check(certificate, self._trust.own_certificate + nonce, signature.Signature)
        except (*INVALID_SIGNATURE, ValueError, TypeError, AttributeError):
            raise StatusCodeError(ua.StatusCodes.BadUserSignatureInvalid) from None
        user = self._users.find_by_certificate(fingerprint(data))
        if user is None or not self._trust.is_valid_now(certificate):
            _log.warning("unknown user certificate %s from %s", fingerprint(data), address)
            raise StatusCodeError(ua.StatusCodes.BadUserAccessDenied)
        return Actor(user.name, user.role, address)
