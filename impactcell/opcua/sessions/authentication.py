"""Logins: identity tokens in, actors out.

Checking a password takes tens of milliseconds on purpose. It happens in threads of its own, so that nobody
who guesses stops the server; `login_throttle` says when.
"""

import asyncio
import logging
import struct
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final

from asyncua import ua
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import padding, rsa

from impactcell.opcua.asyncua_adapter import INVALID_SIGNATURE, SIGNATURE_CHECKS
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.certificates.certificate_files import fingerprint, first_of_chain, parse_certificate
from impactcell.opcua.certificates.trust_list import TrustList
from impactcell.opcua.host_interface import Actor, UserDirectory
from impactcell.opcua.sessions.login_throttle import LoginThrottle

_log = logging.getLogger(__name__)

MAX_PASSWORD_BYTES: Final = 1_024
"""Longest password that is hashed."""
MAX_NAME: Final = 256
"""Longest user name, characters."""

_OAEP: Final = {
    "http://www.w3.org/2001/04/xmlenc#rsa-oaep": hashes.SHA1,
    "http://opcfoundation.org/UA/security/rsa-oaep-sha2-256": hashes.SHA256,
}


@dataclass(frozen=True, slots=True)
class ClientApplication:
    """The client that a user logs in with.

    Attributes
    ----------
    address : str
    certificate : bytes or None
        Its certificate, of which it has proved that it has the key; None without security.
    """

    address: str
    certificate: bytes | None


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
        self, token: Any, signature: ua.SignatureData, nonce: bytes, client: ClientApplication
    ) -> Actor:
        """Find out who a token stands for.

        Raises
        ------
        StatusCodeError
            BadIdentityTokenRejected (a kind that is not taken), BadIdentityTokenInvalid (malformed, or made
            for another nonce), BadUserSignatureInvalid, or BadUserAccessDenied (wrong password, unknown
            user).
        """
        if isinstance(token, ua.UserNameIdentityToken):
            password = self._decrypt(token, nonce, encrypted=client.certificate is not None)
            certificate = fingerprint(client.certificate) if client.certificate else ""
            return await self.identify_by_password(
                token.UserName or "", password, client.address, certificate
            )
        if isinstance(token, ua.X509IdentityToken):
            return self._identify_by_certificate(token, signature, nonce, client.address)
        raise StatusCodeError(ua.StatusCodes.BadIdentityTokenRejected)

    async def identify_by_password(
        self, name: str, password: str, address: str, certificate: str = ""
    ) -> Actor:
        """Find out who a password stands for, wherever it was typed: one throttle for all logins.

        Parameters
        ----------
        certificate : str
            Fingerprint of the client's certificate; empty without one.

        Raises
        ------
        StatusCodeError
            BadUserAccessDenied (wrong password, unknown user), BadIdentityTokenInvalid (longer than any).
        """
        if len(name) > MAX_NAME or len(password.encode()) > MAX_PASSWORD_BYTES:
            raise StatusCodeError(ua.StatusCodes.BadIdentityTokenInvalid)
        async with self._throttle.attempt(address, name, certificate) as attempt:
            user = self._users.find(name)
            matches = await asyncio.get_running_loop().run_in_executor(
                self._pool, self._users.verify_password, user, password
            )
            if matches and user is not None:
                attempt.succeeded()
                self._throttle.remember(name, certificate)
                return Actor(user.name, user.role, address)
            number = attempt.failed()
            _log.warning("wrong password for %r from %s, number %d", name, address, number)
        await asyncio.sleep(attempt.delay_s)
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
