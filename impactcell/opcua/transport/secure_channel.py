"""One secure channel: who may open it, what it lets through, when it ends.

Mended: asyncua opens a channel to any certificate and looks at it only when a session is made, renews for
any lifetime, accepts a second Issue on an open channel, and mixes up the two buffer sizes of Hello and
Acknowledge.
"""

import hashlib
import time
from collections.abc import Sequence
from typing import Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import (
    INVALID_SIGNATURE,
    Buffer,
    SecureConnection,
    SecurityPolicyFactory,
    SecurityPolicyNone,
    StrictBuffer,
    TransportLimits,
    uatcp_to_binary,
)
from impactcell.opcua.binary_codec import StatusCodeError, decode, decode_type, encode
from impactcell.opcua.certificates.trust_list import TrustList, UntrustedError

MAX_CHUNK: Final = 65_536
"""Longest chunk taken and sent, bytes."""
MIN_CHUNK: Final = 8_192
"""Shortest chunk a client may ask for, bytes (Part 6, 7.1.2.3)."""
MAX_OPEN_BYTES: Final = 10_240
"""Longest OPN: a chain of certificates, and few blocks to decrypt, of which each takes a millisecond."""
MAX_ENCRYPTED_BYTES: Final = 2_048
"""The part of it that is encrypted with the server's key: request and signature take half of it at most."""
MIN_LIFETIME_MS: Final = 60_000
"""Shortest lifetime of a security token, milliseconds."""
MAX_LIFETIME_MS: Final = 3_600_000
"""Longest lifetime of a security token, milliseconds: one hour, as the standard's clients ask for."""
NONCE_BYTES: Final = 32
"""Length of a client's nonce (SecureChannelNonceLength of the policies in Part 7)."""
GRACE: Final = 1.25
"""A security token is honoured this much longer than its lifetime (Part 4, 5.5.2)."""


class SecureChannelError(Exception):
    """The connection cannot go on: the code goes out in an Error message, then it is closed."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code


class ChannelSecurity:
    """What all channels share: policies on offer, the trust list, the counter of channels."""

    def __init__(
        self, policies: Sequence[SecurityPolicyFactory], trust: TrustList, message_bytes: int
    ) -> None:
        self.policies = list(policies)
        self.trust = trust
        self.message_bytes = message_bytes
        self._last_id = 0

    def get_new_channel_id(self) -> int:
        """Give a number no other channel of this server has; asyncua calls it by this name."""
        self._last_id += 1
        return self._last_id

    def limits(self) -> TransportLimits:
        """Limits before anybody has logged in: nobody needs a long message for that."""
        return TransportLimits(
            MAX_CHUNK, MAX_CHUNK, self.message_bytes // MIN_CHUNK + 1, min(self.message_bytes, MAX_CHUNK)
        )


class SecureChannel:
    """The secure channel of one connection."""

    def __init__(self, security: ChannelSecurity) -> None:
        self._security = security
        self._limits = security.limits()
        self._secure = SecureConnection(SecurityPolicyNone(), self._limits)
        self._secure.set_policy_factories(security.policies)
        self._max_response = 0
        self._max_response_chunks = 0
        self.expires = float("inf")
        self.unfinished_bytes = 0
        """Bytes of the chunks that have come of a message whose last one has not."""

    @property
    def is_open(self) -> bool:
        """Whether a token has been issued."""
        return bool(self._secure.is_open())

    @property
    def policy(self) -> object:
        """Security policy in use, as asyncua's class."""
        return self._secure.security_policy

    @property
    def policy_uri(self) -> str:
        """URI of the security policy in use."""
        return str(self._secure.security_policy.URI)

    @property
    def is_encrypted(self) -> bool:
        """Whether messages are signed and encrypted."""
        return bool(self._secure.security_policy.Mode == ua.MessageSecurityMode.SignAndEncrypt)

    @property
    def peer_certificate(self) -> bytes | None:
        """Client's certificate, DER; None without security."""
        certificate: bytes | None = getattr(self._secure.security_policy, "peer_certificate", None)
        return certificate or None

    def take_long_messages(self) -> None:
        """Take messages as long as the server takes them: somebody has logged in."""
        self._limits.max_message_size = self._security.message_bytes

    def acknowledge_hello(self, body: bytes) -> bytes:
        """Answer Hello with Acknowledge."""
        message = decode(ua.Hello, StrictBuffer(body))
        if message.EndpointUrl and len(message.EndpointUrl) > 4096:
            raise SecureChannelError(
                ua.StatusCodes.BadTcpEndpointUrlInvalid, "an endpoint URL of more than 4096 characters"
            )
        if min(message.ReceiveBufferSize, message.SendBufferSize) < MIN_CHUNK:
            raise SecureChannelError(
                ua.StatusCodes.BadConnectionRejected, f"buffers smaller than {MIN_CHUNK} bytes"
            )
        self._limits.max_recv_buffer = min(message.SendBufferSize, MAX_CHUNK)
        self._limits.max_send_buffer = min(message.ReceiveBufferSize, MAX_CHUNK)
        self._max_response = message.MaxMessageSize
        self._max_response_chunks = message.MaxChunkCount
        answer = ua.Acknowledge()
        answer.ReceiveBufferSize = self._limits.max_recv_buffer
        answer.SendBufferSize = self._limits.max_send_buffer
        answer.MaxMessageSize = self._security.message_bytes
        answer.MaxChunkCount = self._limits.max_chunk_count
        data: bytes = uatcp_to_binary(ua.MessageType.Acknowledge, answer)
        return data

    def receive(self, header: ua.Header, body: bytes) -> ua.Message | None:
        """Take in one chunk; the message, once it is complete.

        Raises
        ------
        SecureChannelError
            The chunk breaks the protocol or fails its security checks.
        """
        if header.MessageType == ua.MessageType.SecureOpen:
            if len(body) > MAX_OPEN_BYTES:
                raise SecureChannelError(ua.StatusCodes.BadTcpMessageTooLarge, f"an OPN of {len(body)} bytes")
            self._check_open(StrictBuffer(body))
        elif not self.is_open or time.monotonic() > self.expires:
            raise SecureChannelError(ua.StatusCodes.BadSecureChannelClosed, "no open channel")
        self.unfinished_bytes += len(body)
        try:
            message: ua.Message | None = self._secure.receive_from_header_and_body(header, StrictBuffer(body))
        except ua.UaStatusCodeError as error:
            code = error.code
            if code == ua.StatusCodes.BadRequestTooLarge:
                code = ua.StatusCodes.BadTcpMessageTooLarge
            raise SecureChannelError(code, "a message beyond the limits") from error
        except (*INVALID_SIGNATURE, ua.UaError, ValueError, TypeError, OverflowError, IndexError) as error:
            raise SecureChannelError(
                ua.StatusCodes.BadSecurityChecksFailed, f"security checks: {error}"
            ) from error
        if header.ChunkType != ua.ChunkType.Intermediate:
            self.unfinished_bytes = 0
        return message

    def _check_open(self, body: Buffer) -> None:
        security = decode(ua.AsymmetricAlgorithmHeader, body)
        if self.is_open:
            if security.SecurityPolicyURI != self.policy_uri:
                raise SecureChannelError(
                    ua.StatusCodes.BadSecurityPolicyRejected, "another policy on renewal"
                )
        elif security.SecurityPolicyURI == SecurityPolicyNone.URI:
            return
        if security.SecurityPolicyURI == SecurityPolicyNone.URI:
            return
        if not any(policy.matches(security.SecurityPolicyURI) for policy in self._security.policies):
            raise SecureChannelError(
                ua.StatusCodes.BadSecurityPolicyRejected, f"policy {security.SecurityPolicyURI}"
            )
        certificate = security.SenderCertificate
        if not certificate:
            raise SecureChannelError(ua.StatusCodes.BadSecurityChecksFailed, "no certificate")
        if len(body) > MAX_ENCRYPTED_BYTES:
            raise SecureChannelError(
                ua.StatusCodes.BadTcpMessageTooLarge, f"an OPN of {len(body)} encrypted bytes"
            )
        server_certificate = self._security.trust.own_certificate
        if (
            security.ReceiverCertificateThumbPrint
            != hashlib.sha1(server_certificate, usedforsecurity=False).digest()
        ):
            raise SecureChannelError(ua.StatusCodes.BadCertificateInvalid, "meant for another certificate")
        try:
            self._security.trust.check(certificate)
        except UntrustedError as error:
            # Part 4, 6.1.3: the client is told no more than this; the reason stays in our log.
            raise SecureChannelError(
                ua.StatusCodes.BadSecurityChecksFailed, f"client certificate: {error}"
            ) from error

    def open_secure_channel(self, message: ua.Message) -> bytes:
        """Issue or renew the security token; the response, ready to send."""
        body = StrictBuffer(bytes(message.body()))
        if decode_type(body) != ua.NodeId(ua.ObjectIds.OpenSecureChannelRequest_Encoding_DefaultBinary):
            raise SecureChannelError(
                ua.StatusCodes.BadTcpMessageTypeInvalid, "an OPN message without a request to open"
            )
        # The structure begins with the type that has just been read.
        request = decode(ua.OpenSecureChannelRequest, StrictBuffer(bytes(message.body())))
        parameters = request.Parameters
        renew = parameters.RequestType == ua.SecurityTokenRequestType.Renew
        if renew != self.is_open:
            raise SecureChannelError(
                ua.StatusCodes.BadSecureChannelIdInvalid, "issue on an open channel, or renew on none"
            )
        if parameters.SecurityMode != self._secure.security_policy.Mode:
            if renew or self._secure.security_policy.URI == SecurityPolicyNone.URI:
                raise SecureChannelError(
                    ua.StatusCodes.BadSecurityModeRejected, f"mode {parameters.SecurityMode}"
                )
            raise SecureChannelError(ua.StatusCodes.BadSecurityModeRejected, "only SignAndEncrypt is offered")
        if self.is_encrypted and len(parameters.ClientNonce or b"") < NONCE_BYTES:
            raise SecureChannelError(ua.StatusCodes.BadNonceInvalid, "a nonce that is too short")
        parameters.RequestedLifetime = min(
            max(parameters.RequestedLifetime, MIN_LIFETIME_MS), MAX_LIFETIME_MS
        )
        self.expires = time.monotonic() + parameters.RequestedLifetime / 1e3 * GRACE
        response = ua.OpenSecureChannelResponse()
        response.Parameters = self._secure.open(parameters, self._security)
        response.ResponseHeader.RequestHandle = request.RequestHeader.RequestHandle
        data: bytes = self._secure.message_to_binary(
            encode(response), message_type=ua.MessageType.SecureOpen, request_id=message.request_id()
        )
        return data

    def encode_response(self, body: bytes, request_id: int) -> bytes:
        """Turn a response into bytes to send.

        Raises
        ------
        StatusCodeError
            The response is larger than the client takes.
        """
        too_large = self._max_response and len(body) > self._max_response
        if too_large or (
            self._max_response_chunks and len(body) > self._max_response_chunks * self._plain_chunk
        ):
            raise StatusCodeError(ua.StatusCodes.BadResponseTooLarge)
        data: bytes = self._secure.message_to_binary(body, request_id=request_id)
        return data

    @property
    def _plain_chunk(self) -> int:
        return int(self._limits.max_send_buffer) - 256

    def close(self) -> None:
        """Accept no further message."""
        self._secure.close()
